// What hands do on our own page: wheel, keys, clicks, settings and links, each held against what docs/view.md says of it.

import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { pointmill } from "./pointmill.js";
import { serve } from "./server.js";
import { start } from "./view.js";

const SIZE = { width: 640, height: 480 };
/** Milliseconds. */
const PATIENCE = 60_000;
/** A gesture of the wheel, a hover and the address have ended after this time. */
const REST = 600;
const MIDDLE = [320, 240];

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** A hill whose attributes have the names of colourings, and one more that stores no range in a binary tree. */
function writeTable(path) {
  const rows = ["x,y,z,level,one,conf"];
  for (let i = 0; i < 150; i++) {
    for (let k = 0; k < 150; k++) rows.push([500000 + i, 5400000 + k, (100 * Math.exp(-((i - 75) ** 2 + (k - 75) ** 2) / 800)).toFixed(3), i, k, i / 150].join());
  }
  writeFileSync(path, rows.join("\n"));
}

async function open(context, url, lines) {
  const page = await context.newPage();
  await page.setViewportSize(SIZE);
  page.on("pageerror", (error) => lines.push(`exception: ${error.message}`));
  page.setDefaultTimeout(PATIENCE / 4);
  await page.goto(url);
  await page.waitForFunction(() => window.pointmill?.firstPicture, undefined, { timeout: PATIENCE });
  await page.evaluate(() => window.pointmill.idle());
  // larger points, so that each click hits one
  await page.evaluate(() => window.pointmill.change({ size: 3 }));
  return page;
}

/** The wheel comes to the point under the cursor, also where it is far behind the target; and goes back. */
async function wheel(page, lines) {
  const far = () => page.evaluate(() => {
    const { camera, found } = window.pointmill;
    return { eye: Math.hypot(...camera.eye.map((v, a) => v - found[a])), reach: Math.hypot(...camera.eye.map((v, a) => v - camera.target[a])) };
  });
  await page.evaluate(async ([x, y]) => {
    const app = window.pointmill;
    app.look("fit");
    await app.idle();
    app.found = (await app.pointAt(x, y)).point.position;
    // the target comes to a hundredth of the way: beyond it there was no further
    const { camera } = app;
    camera.target = camera.eye.map((v, a) => v + (camera.target[a] - v) / 100);
    camera.update();
  }, MIDDLE);
  const before = await far();
  await page.mouse.move(...MIDDLE);
  for (let i = 0; i < 20; i++) await page.mouse.wheel(0, -200);
  await sleep(2 * REST);
  const after = await far();
  // 40 notches of 1.15 are a factor of 267; the place is that of a pixel, not of the point
  if (!(after.eye < before.eye / 50)) lines.push(`the wheel ends ${after.eye} from the point, it began at ${before.eye}`);
  // nearer than allowed, as after many double clicks: outwards must go on
  const outwards = await page.evaluate(() => {
    const { camera, controls } = window.pointmill;
    camera.target = camera.eye.map((v, a) => v - camera.back[a] * 1e-7);
    camera.update();
    const reach = () => Math.hypot(...camera.eye.map((v, a) => v - camera.target[a]));
    const start = reach();
    for (let i = 0; i < 10; i++) controls.zoom(1.15);
    return reach() / start;
  });
  if (!(outwards > 2)) lines.push(`from too near, ten notches outwards lead ${outwards} times as far`);
}

/** A link restores what is chosen, also in the same tab; flying by keys gets into the address. */
async function links(context, page, lines) {
  const chosen = () => page.evaluate(() => {
    const { renderer: { settings }, clouds, camera } = window.pointmill;
    return JSON.stringify([settings.range, settings.clip, [...settings.hidden], clouds.map((cloud) => cloud.isShown), settings.size, settings.boxes, camera.eye.map((v) => v.toFixed(3))]);
  });
  await page.evaluate(() => {
    const app = window.pointmill;
    app.look("fit");
    app.setColour("height");
    app.chooseRange([3, 7]);
    app.setClip("max", 0, app.box.min[0] + 100);
    app.showClass(2, false);
    app.change({ boxes: true });
  });
  await sleep(REST);
  const [wanted, address] = [await chosen(), page.url()];
  await page.evaluate(() => {
    const app = window.pointmill;
    app.setColour("level");
    app.setClipping(false);
    app.showClass(2, true);
    app.show(app.clouds[0], false);
    app.change({ boxes: false, size: 1 });
    app.look("top");
  });
  await sleep(REST);
  await page.evaluate((hash) => (location.hash = hash), new URL(address).hash);
  await sleep(REST);
  const inTab = await chosen();
  if (inTab !== wanted) lines.push(`a link in the same tab shows ${inTab}, not ${wanted}`);
  const other = await open(context, address, lines);
  const anew = await other.evaluate(() => [window.pointmill.renderer.settings.range, window.pointmill.renderer.settings.clip !== null, window.pointmill.renderer.settings.hidden.has(2)].join());
  await other.close();
  if (anew !== "3,7,true,true") lines.push(`a link in a new tab shows ${anew}`);
  const before = page.url();
  await page.evaluate(() => window.pointmill.setFlying(true));
  const eye = await page.evaluate(() => window.pointmill.camera.eye.join());
  await page.keyboard.down("w");
  await page.waitForFunction((from) => window.pointmill.camera.eye.join() !== from, eye, { timeout: PATIENCE });
  await page.keyboard.up("w");
  await sleep(REST);
  if (page.url() === before) lines.push("the address does not know of a flight");
}

/** No key stays down, and one that is held acts once. */
async function keys(page, lines) {
  const held = () => page.evaluate(() => [...window.pointmill.controls.keys].join());
  await page.evaluate(() => window.pointmill.setFlying(true));
  await page.keyboard.down("w");
  await page.keyboard.down("Control");
  await page.keyboard.up("w");
  await page.keyboard.up("Control");
  if ((await held()) !== "") lines.push(`released with Ctrl, still flying: ${await held()}`);
  await page.keyboard.down("d");
  await page.evaluate(() => window.pointmill.setFlying(false));
  await page.keyboard.up("d");
  await page.evaluate(() => window.pointmill.setFlying(true));
  if ((await held()) !== "") lines.push(`held when the flight ended, flying on in the next: ${await held()}`);
  await page.evaluate(() => window.pointmill.setFlying(false));
  for (let i = 0; i < 4; i++) await page.keyboard.down("m");
  await page.keyboard.up("m");
  if (!(await page.evaluate(() => window.pointmill.measure.isOn))) lines.push("M, held, toggles again and again");
  await page.keyboard.press("m");
  const eye = () => page.evaluate(() => window.pointmill.camera.eye.join());
  for (const key of ["ArrowLeft", "Shift+ArrowUp", "+"]) {
    const before = await eye();
    await page.keyboard.press(key);
    if ((await eye()) === before) lines.push(`${key} does nothing`);
  }
}

/** Points are measured in the order of clicks, and a double click is one. */
async function measuring(page, lines) {
  await page.evaluate(async () => {
    const app = window.pointmill;
    app.setClipping(false);
    app.look("top");
    await app.idle();
    app.measure.toggle();
  });
  let asked = 0;
  await page.route("**/point?*", async (route) => {
    if (asked++ === 0) await sleep(REST);
    await route.continue();
  });
  await page.evaluate(() => {
    window.pointmill.controls.actions.click(250, 240);
    window.pointmill.controls.actions.click(400, 240);
  });
  await page.waitForFunction(() => window.pointmill.measure.points.length === 2, undefined, { timeout: PATIENCE });
  await page.unroute("**/point?*");
  const [first, second] = await page.evaluate(() => window.pointmill.measure.points.map((place) => window.pointmill.camera.project(place)[0]));
  if (!(first < second)) lines.push("the point whose answer was late is the second one");
  await page.evaluate(() => window.pointmill.measure.clear());
  const eye = await page.evaluate(() => window.pointmill.camera.eye.join());
  await page.mouse.dblclick(...MIDDLE);
  await sleep(2 * REST);
  const points = await page.evaluate(() => window.pointmill.measure.points.length);
  if (points !== 1) lines.push(`a double click measures ${points} points`);
  if ((await page.evaluate(() => window.pointmill.camera.eye.join())) !== eye) lines.push("a double click while measuring moves the camera");
}

/** Attributes that are called as colourings are, a range that is typed, a note that gives way. Of a page on a web server. */
async function settings(page, lines) {
  const menu = page.locator("#panel select[title=Colour]");
  const options = await menu.evaluate((select) => [...select.options].map(({ value, textContent }) => `${value}=${textContent}`));
  if (new Set(options.map((option) => option.split("=")[0])).size !== options.length) lines.push(`the menu of colours has an entry twice: ${options}`);
  await menu.selectOption("attribute:level");
  await page.evaluate(() => window.pointmill.idle());
  const range = () => page.evaluate(() => window.pointmill.renderer.settings.range.join());
  if ((await range()) !== "0,149") lines.push(`the attribute "level" has the range ${await range()}`);
  await menu.selectOption("attribute:conf");
  await page.evaluate(() => window.pointmill.idle());
  const field = page.locator('#panel input[title="Range, start"]');
  await field.fill("0.4");
  await field.press("Enter");
  await sleep(REST);
  if (!(await range()).startsWith("0.4,")) lines.push(`a range of 0.4 was typed, it is ${await range()}`);
  const said = await page.evaluate(() => {
    const { messages } = window.pointmill;
    for (let i = 0; i < 5; i++) messages.note(`note ${i}`);
    messages.fail("an error");
    return document.getElementById("messages").innerText;
  });
  if (!said.includes("an error")) lines.push("an error is not seen beside five notes");
}

/** A page whose scripts may not run says so. */
async function forbidden(context, url, lines) {
  const page = await context.newPage();
  await page.route(url, async (route) => {
    const response = await route.fetch();
    await route.fulfill({ response, headers: { ...response.headers(), "content-security-policy": "default-src 'self'" } });
  });
  await page.goto(url);
  const text = await page.evaluate(() => document.body.innerText);
  if (!text.includes("script-src")) lines.push(`without scripts the page says ${JSON.stringify(text)}`);
  await page.close();
}

/** What a check waited for in vain is a line, too. */
const tried = (check, lines) => check.catch((error) => lines.push(error.message.split("\n")[0]));

/** Checks the page of an octree of `scan`, live, and that of a table, on a web server. Returns the number of failures. */
export async function checkControls(context, out, report) {
  const table = join(out, "scans", "table.csv");
  writeTable(table);
  const path = (kind) => join(out, "data", `controls-${kind}`);
  pointmill("convert", table, "-o", path("potree2"), "--to", "potree2", "--overwrite", "--quiet");
  pointmill("convert", table, "-o", path("bintree"), "--to", "bintree", "--attributes", "level,one,conf", "--page", "--overwrite", "--quiet");
  let failures = 0;
  const single = await start(path("potree2"));
  for (const [title, check] of Object.entries({ wheel, links: (page, lines) => links(context, page, lines), keys, measuring })) {
    const lines = [];
    const page = await open(context, single.url, lines);
    await page.locator("#picture").focus();
    await tried(check(page, lines), lines);
    await page.close();
    failures += report(`the page by hand: ${title}`, lines);
  }
  await single.stop();
  const server = await serve({ data: join(out, "data") });
  const url = `${server.url}/data/controls-bintree.html`;
  const lines = [];
  const page = await open(context, url, lines);
  await tried(settings(page, lines), lines);
  await page.close();
  await tried(forbidden(context, url, lines), lines);
  await server.close();
  return failures + report("the page by hand: settings, and without scripts", lines);
}
