// What the page shows when something is amiss: a connection that is gone for a while, a node that is broken, values of other types
// than usual. Each of these once gave wrong pictures, or points that never came.

import { closeSync, openSync, readFileSync, writeFileSync, writeSync } from "node:fs";
import { join } from "node:path";
import { pointmill } from "./pointmill.js";
import { serve } from "./server.js";
import { start } from "./view.js";

const SIZE = { width: 640, height: 480 };
const PATIENCE = 60_000; // milliseconds
/** Nine pixels around the cursor are searched, corners included; half a pixel for the rounding of positions. */
const MOST_AWAY = 6.5;
/** The least budget that a link may have. */
const FEW = 10_000;

async function open(context, url) {
  const page = await context.newPage();
  await page.setViewportSize(SIZE);
  await page.goto(url);
  await page.waitForFunction(() => window.pointmill?.firstPicture, undefined, { timeout: PATIENCE });
  await page.evaluate(() => window.pointmill.idle());
  return page;
}

/** Runs in the page: where drawn points are, and where the dataset has them; pixels. */
async function picks() {
  const app = window.pointmill;
  const out = [];
  for (let i = 0; i < 64; i++) {
    const at = [((i % 8) + 1) / 9, (Math.floor(i / 8) + 1) / 9].map((part, a) => Math.round(part * [app.camera.width, app.camera.height][a]));
    const found = await app.pointAt(...at);
    if (!found) continue;
    const pixel = app.camera.project(found.point.position);
    out.push(Math.hypot(pixel[0] - at[0], pixel[1] - at[1]));
  }
  return out;
}

/** Runs in the page: units by their state, and points that are drawn. */
function state() {
  const [cloud] = window.pointmill.clouds;
  const units = cloud.nodes ? [...cloud.nodes.values()] : (cloud.leaves ?? cloud.slots.flatMap((slot) => slot.parts));
  const count = (is) => units.filter(is).length;
  return {
    failed: count((unit) => unit.state === "failed"),
    held: count((unit) => unit.block),
    current: cloud.visible.filter((unit) => unit.block.extraRange).length,
    visible: cloud.visible.length,
    points: cloud.shown,
    requests: window.pointmill.loader.requests,
    said: [...document.querySelectorAll("#messages p")].map((p) => p.firstChild.textContent),
  };
}

/** Points are drawn where the dataset has them. */
async function places(context, path, report) {
  const lines = [];
  const { url, stop } = await start(path);
  const page = await open(context, url);
  for (const view of ["fit", "top"]) {
    await page.evaluate((name) => (window.pointmill.look(name), window.pointmill.idle()), view);
    const away = await page.evaluate(picks);
    if (away.length < 5) lines.push(`${view}: only ${away.length} points were found`);
    if (away.some((pixels) => !(pixels <= MOST_AWAY))) lines.push(`${view}: picked points are up to ${Math.max(...away)} pixels from the cursor`);
  }
  await page.close();
  return report("the page: leaves of a binary tree are where they are", [...lines, ...(await stop())]);
}

/** A plane whose intensity grows with x, as PLY with intensities of a type. */
function ramp(type, greatest) {
  const rows = Array.from({ length: 20_000 }, (_, i) => [i % 200, Math.floor(i / 200), 0, ((i % 200) / 199) * greatest]);
  const head = `ply\nformat ascii 1.0\nelement vertex ${rows.length}\n${["x", "y", "z"].map((axis) => `property double ${axis}\n`).join("")}property ${type} intensity\nend_header\n`;
  return head + rows.map((row) => `${row.join(" ")}\n`).join("");
}

/** Runs in the page: how many different colours there are. */
async function colours() {
  const app = window.pointmill;
  app.change({ edl: 0 });
  await app.idle();
  app.frame();
  const { gl } = app;
  const pixels = new Uint32Array(gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(pixels.buffer));
  return { colour: app.renderer.settings.colour, count: new Set(pixels).size };
}

/** Intensities of all types are a gradient. */
async function intensities(context, out, report) {
  const lines = [];
  const server = await serve({ data: join(out, "data") });
  for (const [type, greatest] of [["float", 1], ["float", 4000]]) {
    const scan = join(out, "scans", `ramp-${greatest}.ply`);
    writeFileSync(scan, ramp(type, greatest));
    for (const kind of ["potree2", "bintree"]) {
      const name = `ramp-${greatest}-${kind}`;
      const made = join(out, "data", name);
      pointmill("convert", scan, "-o", made, "--to", kind, "--attributes", "intensity", "--page", "--overwrite", "--quiet");
      const { url, stop } = await start(made);
      for (const address of [url, `${server.url}/data/${name}.html`]) {
        const page = await open(context, address);
        const { colour, count } = await page.evaluate(colours);
        // the gradient has 256, of which the plane shows 200 values
        if (colour !== "intensity" || count < 100) lines.push(`${address === url ? "live" : "static"} ${name} has ${count} colours, by ${colour}`);
        await page.close();
      }
      lines.push(...(await stop()));
    }
  }
  await server.close();
  return report("the page: intensities that are no 16 bits are a gradient", lines);
}

/** What was missed while the connection was gone comes afterwards. */
async function interruption(context, path, kind, report) {
  const lines = [];
  const { url, stop } = await start(path);
  let page = await open(context, url);
  const meant = await page.evaluate(state);
  await page.close();
  page = await open(context, `${url}#budget=${FEW}`);
  const before = await page.evaluate(state);
  await context.setOffline(true);
  await page.evaluate(() => window.pointmill.setBudget(1e6));
  await page.waitForFunction(() => document.querySelector("#messages p"), undefined, { timeout: PATIENCE });
  const during = await page.evaluate(state);
  await context.setOffline(false);
  await page.evaluate(() => window.pointmill.idle());
  const after = await page.evaluate(state);
  if (before.points >= meant.points / 2) lines.push(`${before.points} of ${meant.points} points are there before`);
  if (during.points === 0) lines.push("what was loaded did not stay");
  if (during.said.length !== 1 || during.failed > 0) lines.push(`while it is gone the page says ${during.said}`);
  if (after.failed > 0 || after.points !== meant.points) lines.push(`${after.points} points and ${after.failed} failed units afterwards, not ${meant.points}`);
  if (after.said.length > 0) lines.push(`afterwards the page says ${after.said}`);
  lines.push(...(await recolour(page)));
  await page.close();
  return report(`the page: ${kind} after the connection was gone`, [...lines, ...(await stop())]);
}

/** Another attribute and back: points stay until those with it come, and going back needs nothing. */
async function recolour(page) {
  const lines = [];
  const before = await page.evaluate(state);
  const least = await page.evaluate(async () => {
    const app = window.pointmill;
    const name = app.clouds[0].scene.attributes.findLast((each) => !["rgb", "rgba", "intensity"].includes(each.name)).name;
    let least = Infinity;
    app.setColour(app.panel.colour.querySelector(`option[value$="${name}"]`)?.value ?? name);
    do {
      app.frame();
      least = Math.min(least, app.clouds[0].shown);
      await new Promise((done) => setTimeout(done, 5));
    } while (!app.isIdle);
    return least;
  });
  const other = await page.evaluate(state);
  await page.evaluate(() => (window.pointmill.setColour("rgb"), window.pointmill.idle()));
  const back = await page.evaluate(state);
  if (least < before.points) lines.push(`${least} of ${before.points} points were left while another attribute came`);
  if (other.points !== before.points || other.current !== other.visible) lines.push(`with it, ${other.points} points and ${other.current} of ${other.visible} units have come`);
  if (back.requests !== other.requests) lines.push(`going back took ${back.requests - other.requests} requests`);
  return lines;
}

/** The node of level 1 with the most points has no valid bytes. */
function spoil(path) {
  const { hierarchy } = JSON.parse(readFileSync(join(path, "metadata.json")));
  const records = readFileSync(join(path, "hierarchy.bin"));
  const names = ["r"];
  const found = [];
  for (let at = 0; at < hierarchy.firstChunkSize; at += 22) {
    const name = names[at / 22];
    for (let child = 0; child < 8; child++) if ((records[at + 1] >> child) & 1 && records[at] !== 2) names.push(name + child);
    found.push({ name, points: records.readUInt32LE(at + 2), offset: Number(records.readBigUInt64LE(at + 6)), size: Number(records.readBigUInt64LE(at + 14)) });
  }
  const [node] = found.filter(({ name }) => name.length === 2).sort((a, b) => b.points - a.points);
  const file = openSync(join(path, "octree.bin"), "r+");
  writeSync(file, Buffer.alloc(Math.min(64, node.size), 0xff), 0, undefined, node.offset);
  closeSync(file);
  return { node, below: found.filter(({ name }) => name.startsWith(node.name) && name !== node.name).length };
}

/** A broken node takes neither those of its request nor those below it away. */
async function brokenNode(context, scan, out, report) {
  const lines = [];
  const path = join(out, "data", "steady-broken");
  pointmill("convert", scan, "-o", path, "--to", "potree2", "--encoding", "brotli", "--overwrite", "--quiet");
  const { node, below } = spoil(path);
  const { url, stop } = await start(path);
  const page = await open(context, url);
  const { failed, held, visible, said } = await page.evaluate(state);
  if (below === 0) lines.push(`nothing is below ${node.name}`);
  const above = await page.evaluate((name) => window.pointmill.clouds[0].visible.filter((each) => each.name.startsWith(name)).length, node.name);
  if (failed !== 1) lines.push(`${failed} nodes failed`);
  if (held !== visible) lines.push(`${visible} nodes of ${held} are drawn`);
  if (above === 0) lines.push(`nothing below ${node.name} is drawn`);
  if (said.length !== 1 || !said[0].includes(node.name)) lines.push(`the page says ${said}`);
  await page.close();
  return report("the page: a node that is broken is the only one that is missing", [...lines, ...(await stop())]);
}

/** Leaves that were loaded for a near view do not count for ever. */
async function budget(context, path, report) {
  const lines = [];
  const { url, stop } = await start(path);
  const page = await open(context, url);
  const all = await page.evaluate(state);
  const most = Math.round(all.points / 3);
  await page.evaluate((points) => (window.pointmill.setBudget(points), window.pointmill.idle()), most);
  const { points } = await page.evaluate(state);
  if (points > most || points < most / 16) lines.push(`${points} points of ${all.points}, the budget is ${most}`);
  await page.close();
  return report("the page: the budget of a binary tree is kept", [...lines, ...(await stop())]);
}

/** `path(kind)`: datasets as page.js makes them. Returns the number of failures. */
export async function checkSteady(context, scan, path, out, report) {
  let failures = await places(context, path("bintree"), report);
  failures += await intensities(context, out, report);
  for (const kind of ["potree2", "bintree", "batches"]) failures += await interruption(context, path(kind), kind, report);
  failures += await brokenNode(context, scan, out, report);
  return failures + (await budget(context, path("bintree"), report));
}
