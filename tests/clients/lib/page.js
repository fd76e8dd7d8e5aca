// Our own page (crates/view/page), in the browser: behind `pointmill view` and beside a dataset on a web server. What the page decodes
// itself is held against what the format crate decodes for it, its picture against that of `pointmill preview`.

import { createServer } from "node:http";
import { readFileSync, truncateSync } from "node:fs";
import { join } from "node:path";
import { checkControls } from "./controls.js";
import { pointmill } from "./pointmill.js";
import { serve } from "./server.js";
import { checkSteady } from "./steady.js";
import { start } from "./view.js";

const KINDS = {
  potree2: ["--to", "potree2"],
  potree1: ["--to", "potree1", "--attributes", "rgb,intensity,classification"],
  bintree: ["--to", "bintree", "--attributes", "rgba,intensity", "--capacity", "20000"],
  batches: ["--to", "batches", "--attributes", "intensity,gps-time"],
};
const SIZE = { width: 640, height: 480 };
/** Until there is a first picture. */
const MOST = { requests: 30, bytes: 5e6 };
/** Milliseconds. */
const PATIENCE = 60_000;
/** What Chromium says of its own software rendering. */
const OWN = /GL Driver Message|Automatic fallback to software WebGL/;

/**
 * Part of the covered pixels that may have a colour that the picture of `preview` has in none of the nine pixels there. Inner nodes
 * come on 65,535 steps of their box: of a box as wide as the picture a point is off by 1/200 of a pixel at most and 1/400 in the
 * mean, so that 1 point of 200 is in the pixel beside (two axes), of near ones two or three times as many. It changes two pixels,
 * and there are three points to a pixel: up to 7 % of the pixels change, in about a quarter of them to a colour that was hidden
 * there. A picture that is moved by three pixels must differ by far more.
 */
const MOST_DIFFERENT = 0.03;
const SHIFT = 3;

/** Runs in the page: sums of every unit of every dataset, by the page's own decoders. */
async function sums() {
  const out = {};
  for (const cloud of window.pointmill.clouds) {
    const { source, scene } = cloud;
    const units = [];
    if (scene.kind === "octree") {
      const chunks = ["r"];
      while (chunks.length > 0) {
        for (const node of await source.chunk(chunks.pop())) {
          if (node.isProxy && !units.some((u) => u === node.name)) chunks.push(node.name);
          if (!units.includes(node.name) && node.points > 0) units.push(node.name);
        }
      }
    } else for (const { unit } of await source.boxes()) units.push(unit);
    const rows = {};
    for (const unit of units) {
      const [points] =
        scene.kind === "batches"
          ? await source.batches([unit], { planes: 3, lods: [0, 255], attribute: "intensity" })
          : await source.points([unit], { attribute: "intensity", every: 1 });
      const step = scene.kind === "batches" ? 0 : Math.max(...points.step);
      const row = { count: points.count, step, places: [0, 0, 0], colours: 0, extra: 0 };
      for (let i = 0; i < points.count; i++) {
        for (let a = 0; a < 3; a++) {
          if (scene.kind === "batches") {
            const t = points.planes.reduce((sum, plane) => sum * 1024 + ((plane[i] >>> (10 * a)) & 1023), 0);
            row.places[a] += points.min[a] + (t + 0.5) * points.sides[a] / 1024 ** points.planes.length - scene.bounds.min[a];
          } else row.places[a] += points.origin[a] + points.places[4 * i + a] * points.step[a] - scene.bounds.min[a];
        }
        // the last byte of batches is the level of detail
        for (let c = 0; c < 4; c++) row.colours += points.colours[4 * i + c] * ((i % 97) + 1) * (c + 1);
        row.extra += points.extra ? points.extra[i] * ((i % 89) + 1) : 0;
      }
      rows[unit] = row;
    }
    out[`${scene.kind} ${scene.format}`] = { rows, points: scene.points };
  }
  return out;
}

/** Runs in the page: what differs from a picture, given as PNG; all points are drawn as pixels. */
async function compare({ png, shift }) {
  const app = window.pointmill;
  app.change({ size: 1, isAdaptive: false, edl: 0, least: 1, most: 1, boxes: false });
  app.setBudget(1e7);
  app.each("batches", { clod: 0, bits: 30 });
  await app.idle();
  app.frame();
  const { gl } = app;
  const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  const own = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, own);
  // not by fetch, which the page's policy allows to its own server alone
  const bytes = Uint8Array.from(atob(png), (letter) => letter.charCodeAt(0));
  const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }), { colorSpaceConversion: "none" });
  const canvas = new OffscreenCanvas(width, height).getContext("2d");
  canvas.drawImage(image, 0, 0);
  const other = canvas.getImageData(0, 0, width, height).data;
  // row 0 is at the top in `other`, at the bottom in `own`
  const pixel = (data, at) => [data[at], data[at + 1], data[at + 2]];
  const theirs = (x, y) => pixel(other, 4 * (y * width + x));
  const ours = (x, y) => pixel(own, 4 * ((height - 1 - y) * width + x));
  const near = (a, b) => [0, 1, 2].every((c) => Math.abs(a[c] - b[c]) <= 2);
  const [back, ownBack] = [theirs(0, 0), ours(0, 0)];
  // one background for both
  const seen = (colour, background) => (near(colour, background) ? [-99, -99, -99] : colour);
  const isAround = (colour, x, y) => {
    for (let dy = -1; dy <= 1; dy++) for (let dx = -1; dx <= 1; dx++) if (near(colour, seen(theirs(x + dx, y + dy), back))) return true;
    return false;
  };
  let [covered, different, shifted] = [0, 0, 0];
  for (let y = 1; y < height - 1; y++) {
    for (let x = shift + 1; x < width - 1; x++) {
      if (near(theirs(x, y), back) && near(ours(x, y), ownBack)) continue;
      covered++;
      different += !isAround(seen(ours(x, y), ownBack), x, y);
      shifted += !isAround(seen(ours(x - shift, y), ownBack), x, y);
    }
  }
  return { width, height, size: [image.width, image.height], covered, different: different / covered, shifted: shifted / covered, points: app.stats().points };
}

/** Runs in the page: pixels of points that were picked there, and how far they are from the cursor. */
async function picks() {
  const app = window.pointmill;
  const out = [];
  for (const [x, y] of [[0.5, 0.5], [0.4, 0.55], [0.55, 0.6], [0.6, 0.5], [0.45, 0.45]]) {
    const at = [x * app.camera.width, y * app.camera.height];
    const found = await app.pointAt(...at);
    if (!found) continue;
    const pixel = app.camera.project(found.point.position);
    out.push(Math.hypot(pixel[0] - at[0], pixel[1] - at[1]));
  }
  return out;
}

/** A page of the browser that keeps every complaint in `lines`. */
async function open(context, url, lines) {
  const page = await context.newPage();
  await page.setViewportSize(SIZE);
  page.on("console", (message) => {
    if (["error", "warning"].includes(message.type()) && !OWN.test(message.text())) lines.push(`console: ${message.text()}`);
  });
  page.on("pageerror", (error) => lines.push(`exception: ${error.message}`));
  await page.goto(url);
  await page.waitForFunction(() => window.pointmill?.firstPicture || document.querySelector("#messages p"), undefined, { timeout: PATIENCE });
  return page;
}

const messages = (page) => page.evaluate(() => [...document.querySelectorAll("#messages p")].map((p) => p.firstChild.textContent));

/** Two tables of sums, of the same datasets by different decoders. */
function unequal(ours, theirs, name) {
  const lines = [];
  if (Object.keys(ours).length !== Object.keys(theirs).length) lines.push(`${name}: ${Object.keys(ours).length} units, not ${Object.keys(theirs).length}`);
  for (const [unit, row] of Object.entries(theirs)) {
    const own = ours[unit];
    if (!own) lines.push(`${name}: unit ${unit} is not there`);
    else {
      // each point is within half a step of the server's, which rounds inner nodes to 65,535 steps of their box; 10^-6 for the sums
      const far = row.places.some((place, a) => Math.abs(place - own.places[a]) > (row.step / 2 + 1e-6) * row.count);
      const extra = Math.abs(row.extra - own.extra) > 1e-6 * Math.abs(row.extra);
      if (far || extra || row.count !== own.count || row.colours !== own.colours) lines.push(`${name}: unit ${unit} differs: ${JSON.stringify([own, row])}`);
    }
  }
  return lines.slice(0, 3);
}

/** Checks the page; `report(title, lines)` prints and counts. Returns the number of failures. */
export async function checkPage(context, scan, out, report) {
  const path = (kind) => join(out, "data", `page-${kind}`);
  for (const [kind, args] of Object.entries(KINDS)) pointmill("convert", scan, "-o", path(kind), "--page", "--overwrite", "--quiet", ...args);
  let failures = 0;
  const { table, url, stop } = await behindTheProgram(context, path, out, report, (n) => (failures += n));
  failures += await alone(context, path, table, out, report);
  failures += await withoutRanges(context, path, report);
  failures += await checkSteady(context, scan, path, out, report);
  failures += await checkControls(context, out, report);
  failures += await broken(context, path, url, report);
  failures += report("the page: the program ends", await stop());
  return failures;
}

async function behindTheProgram(context, path, out, report, count) {
  const lines = [];
  const { url, stop } = await start(...Object.keys(KINDS).map(path));
  let page = await open(context, url, lines);
  const stats = await page.evaluate(() => window.pointmill.stats());
  for (const [name, most] of Object.entries(MOST)) if (stats[name] > most) lines.push(`${stats[name]} ${name} until there is a picture`);
  const table = await page.evaluate(sums);
  for (const [name, { rows, points }] of Object.entries(table)) {
    const found = Object.values(rows).reduce((sum, row) => sum + row.count, 0);
    if (found !== points) lines.push(`${name}: ${found} points, not ${points}`);
  }
  await page.evaluate(() => window.pointmill.idle());
  await page.screenshot({ path: join(out, "pictures", "page-all.png") });
  lines.push(...(await messages(page)));
  await page.close();
  count(report(`the page, four datasets: picture after ${Math.round(stats.firstPicture)} ms, ${stats.requests} requests, ${(stats.bytes / 1e6).toFixed(1)} MB`, lines));
  for (const kind of ["potree2", "batches", "bintree"]) {
    const single = await start(path(kind));
    const of = [];
    page = await open(context, single.url, of);
    count(report(...(await samePicture(page, kind, path(kind), out, of))));
    await page.close();
    of.splice(0, of.length, ...(await single.stop()));
    count(report(`the page: the program with ${kind} alone ends`, of));
  }
  return { table, url, stop };
}

/** The picture of the page and that of `pointmill preview` from the same camera; and points under the cursor. */
async function samePicture(page, kind, dataset, out, lines) {
  await page.evaluate(() => window.pointmill.idle()); // what comes first has few points
  const far = await page.evaluate(picks);
  // nine pixels around the cursor are searched, corners included
  if (far.length < 3 || far.some((pixels) => pixels > 6.5)) lines.push(`picked points are ${far} pixels from the cursor`);
  const { eye, target, fov } = await page.evaluate(() => window.pointmill.camera);
  const png = join(out, "pictures", `page-${kind}-preview.png`);
  const camera = [...eye, ...target, 0, 0, 1, fov].join(",");
  pointmill("preview", dataset, "-o", png, "--overwrite", "--quiet", "--shading", "plain", "--size", `${SIZE.width}x${SIZE.height}`, `--camera=${camera}`, "--budget", "10000000", ...(kind === "batches" ? ["--bits", "30"] : []));
  const found = await page.evaluate(compare, { png: readFileSync(png).toString("base64"), shift: SHIFT });
  await page.screenshot({ path: join(out, "pictures", `page-${kind}.png`) });
  if (found.width !== SIZE.width || found.height !== SIZE.height) lines.push(`the picture has ${found.width} x ${found.height} pixels`);
  if (found.covered < 10_000) lines.push(`only ${found.covered} pixels are covered`);
  if (!(found.different <= MOST_DIFFERENT)) lines.push(`${(100 * found.different).toFixed(2)} % of the pixels differ from preview: ${JSON.stringify(found)}`);
  if (!(found.shifted > 10 * MOST_DIFFERENT)) lines.push(`a picture that is moved by ${SHIFT} pixels differs by ${found.shifted} only: the comparison finds nothing`);
  return [`the page and preview, ${kind}: ${(100 * found.different).toFixed(2)} % of ${found.covered} pixels differ`, lines];
}

/** Pages beside datasets decode as the format crate does. */
async function alone(context, path, table, out, report) {
  let failures = 0;
  const server = await serve({ data: join(out, "data") });
  for (const kind of Object.keys(KINDS)) {
    const lines = [];
    const page = await open(context, `${server.url}/data/page-${kind}.html`, lines);
    const [[name, { rows }] = [kind, { rows: {} }]] = Object.entries(await page.evaluate(sums));
    const key = Object.keys(table).find((each) => each.split(" ")[0] === name.split(" ")[0] && (kind !== "potree1" || each.includes("Potree 1")) && (kind !== "potree2" || each.includes("Potree 2")));
    lines.push(...unequal(rows, table[key]?.rows ?? { none: {} }, kind));
    await page.evaluate(() => window.pointmill.idle());
    await page.screenshot({ path: join(out, "pictures", `page-${kind}-static.png`) });
    lines.push(...(await messages(page)));
    await page.close();
    failures += report(`the page of ${kind} on a web server: ${Object.keys(rows).length} units as the format crate decodes them`, lines);
  }
  await server.close();
  return failures;
}

/** A server that sends whole files is named. */
async function withoutRanges(context, path, report) {
  const lines = [];
  const server = createServer((request, response) => {
    try {
      response.end(readFileSync(join(path(""), "..", decodeURIComponent(new URL(request.url, "http://host").pathname))));
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  const page = await open(context, `http://127.0.0.1:${server.address().port}/page-potree2.html`, lines);
  await page.evaluate(() => window.pointmill.idle());
  const said = await messages(page);
  if (!said.some((line) => line.includes("ignores ranges"))) lines.push(`a server without ranges is not named: ${said}`);
  const { points } = await page.evaluate(() => window.pointmill.stats());
  if (points === 0) lines.push("nothing is shown, although the file is small");
  await page.close();
  server.closeAllConnections();
  await new Promise((done) => server.close(done));
  return report("the page: a server without ranges is named", lines);
}

/** A dataset that breaks while it is viewed: a line, and the page goes on. */
async function broken(context, path, url, report) {
  const lines = [];
  truncateSync(join(path("potree2"), "octree.bin"), 1000);
  const page = await open(context, url, lines);
  await page.evaluate(() => window.pointmill.idle());
  const said = await messages(page);
  if (!said.some((line) => line.includes("octree.bin"))) lines.push(`a file that is cut is not told of: ${said}`);
  const { points } = await page.evaluate(() => window.pointmill.stats());
  if (points === 0) lines.push("the other datasets are not shown");
  await page.close();
  // the browser's own line about an answer that is an error
  return report("the page: a dataset that breaks is a line", lines.filter((line) => !line.includes("Failed to load resource")));
}
