// Makes the datasets, loads all of them in all clients, and says what differs. `npm test` and `./run` begin here.
//
//   node run.js [TEXT...]     only datasets whose name has one of these texts in it
//
// The job that a page gets: `url` and `format` of the dataset; `whole`, if points are fetched at once; `points`, `columns`,
// `lattice`, `slack` of what is expected; `draw`, `box`, `balls`, `colourBy`, `intensity` for the picture.

import { existsSync, mkdirSync, readFileSync, rmSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { POTREE, bundle, runPage, startBrowser } from "./lib/browser.js";
import { differences } from "./lib/compare.js";
import { DATASETS, seconds } from "./lib/datasets.js";
import { expected } from "./lib/expected.js";
import { FAULTS, plant } from "./lib/faults.js";
import { writeLas } from "./lib/las.js";
import { BINARY, info, pointmill, validate } from "./lib/pointmill.js";
import { SCENES } from "./lib/scenes.js";
import { serve } from "./lib/server.js";
import { checkPage } from "./lib/page.js";
import { checkView } from "./lib/view.js";

const OUT = fileURLToPath(new URL("./out", import.meta.url));
const AEROSCAN = fileURLToPath(new URL("../../fixtures/las/autzen_trim.laz", import.meta.url));

const wanted = process.argv.slice(2);
const isPageWanted = wanted.length === 0 || wanted.includes("page");
const datasets = DATASETS.filter(({ name }) => wanted.length === 0 || wanted.some((text) => name.includes(text)));

/** Writes the scans of all scenes that are needed, and returns them by name, with their paths. */
async function makeScenes() {
  const scenes = {};
  for (const name of new Set(datasets.map(({ scene }) => scene))) {
    const scan = await SCENES[name]();
    scan.path = name === "aerial" ? AEROSCAN : join(OUT, "scans", `${name}.las`);
    if (name !== "aerial") writeLas(scan.path, scan);
    scenes[name] = scan;
  }
  return scenes;
}

/** Converts and describes a dataset: what clients are held against. */
function makeDataset(dataset, scan) {
  const folder = join(OUT, "data", dataset.name);
  pointmill("convert", scan.path, "-o", folder, "--overwrite", "--quiet", ...dataset.args);
  const path = dataset.format === "copc" ? join(folder, "points.copc.laz") : folder;
  return { path, expected: expected(scan, dataset.format, dataset.every), validated: validate(path), levels: levels(info(path)) };
}

function jobOf(dataset, { expected }, scan, url) {
  const coloured = expected.names.includes("r");
  // the step of Potree 1 is finer than the scan's, but corners of deep nodes are no multiples of it (potree1.md §7)
  const slack = dataset.format === "potree1" ? cloudScale(dataset.name) / 2 : 0;
  return {
    url,
    format: dataset.format,
    points: expected.sums.count,
    columns: expected.names,
    lattice: expected.lattice,
    slack,
    box: expected.box,
    balls: (scan.columns.r && scan.balls) ?? [],
    whole: dataset.scene === "deep",
    draw: dataset.scene !== "deep", // too many nodes to be put into a scene one by one
    colourBy: coloured ? undefined : "INTENSITY",
    intensity: coloured ? undefined : expected.ranges.intensity,
  };
}

/** Levels of an octree; those of a COPC file are beside what it is as a scan. */
const levels = (described) => (described.octree ?? described).nodes_per_level.length;

const cloudScale = (name) => JSON.parse(readFileSync(join(OUT, "data", name, "cloud.js"))).scale;

/** Loads a dataset in a client and returns the differences. */
async function check(browser, server, { dataset, client, made, job, screenshot }) {
  server.reset();
  let lines;
  let found = {};
  try {
    found = await runPage(browser.context, `${server.url}/${client}.html`, job, { seconds: seconds(dataset), screenshot });
    lines = differences(found, { ...made, dataset, client, balls: job.balls });
  } catch (error) {
    lines = [error.message];
  }
  for (const { path, status, range } of server.log) {
    if (status >= 400) lines.push(`the server answered ${status} to ${path} ${range ?? ""}`);
  }
  const bytes = server.log.reduce((sum, entry) => sum + entry.bytes, 0);
  return { lines, found, requests: server.log.length, bytes };
}

async function main() {
  if (!existsSync(BINARY)) throw new Error(`${BINARY} is not there: build it with cargo, or name another one in POINTMILL`);
  if (datasets.length === 0 && !isPageWanted) throw new Error(`no dataset is called ${wanted.join(" or ")}`);
  rmSync(OUT, { recursive: true, force: true });
  for (const folder of ["scans", "data", "pages", "pictures"]) mkdirSync(join(OUT, folder), { recursive: true });
  await bundle(join(OUT, "pages"));
  const scenes = await makeScenes();
  const server = await serve({ data: join(OUT, "data"), ...(POTREE && { potree: POTREE }), "": join(OUT, "pages") });
  const browser = await startBrowser();
  let failures = 0;
  try {
    for (const dataset of datasets) {
      const scan = scenes[dataset.scene];
      const made = makeDataset(dataset, scan);
      const url = `/data/${dataset.name}${dataset.format === "copc" ? "/points.copc.laz" : ""}`;
      if (!made.validated.ok) failures += report(`${dataset.name}: validate finds faults`, made.validated.problems.map(String));
      const { lines, figures: opened } = await checkView(browser.context, made.path, made, join(OUT, "pictures", `${dataset.name}-view.png`));
      failures += report(`${dataset.name} in pointmill view: ${opened}`, lines);
      for (const client of dataset.clients) {
        const job = jobOf(dataset, made, scan, url);
        const started = performance.now();
        const result = await check(browser, server, { dataset, client, made, job, screenshot: join(OUT, "pictures", `${dataset.name}-${client}.png`) });
        const took = `${((performance.now() - started) / 1000).toFixed(1)} s`;
        failures += report(`${dataset.name} in ${client}: ${figures(result)}${took}`, result.lines);
        failures += await plantAll(browser, server, { dataset, client, made, job, drawn: Boolean(result.found.picture) });
      }
    }
    if (isPageWanted) failures += await checkPage(browser.context, AEROSCAN, OUT, report);
  } finally {
    await browser.close();
    await server.close();
  }
  console.log(failures === 0 ? "all clients see what was scanned" : `${failures} failed`);
  process.exitCode = failures === 0 ? 0 : 1;
}

/** What came, if something did. */
function figures({ found: { nodes, depth, chunks, worst }, requests, bytes }) {
  if (nodes === undefined) return "";
  const tree = `${nodes} nodes to level ${depth}, ${chunks} chunks deep`;
  return `${tree}, ${requests} requests, ${(bytes / 1e6).toFixed(1)} MB, rounding ${worst.toFixed(2)} of its bound, `;
}

/** Prints a line, and below it what is wrong; returns the number of failures. */
function report(title, lines) {
  console.log(`${lines.length === 0 ? "ok  " : "FAIL"} ${title}`);
  for (const line of lines) console.log(`       ${line}`);
  return lines.length === 0 ? 0 : 1;
}

/** Plants each fault that this dataset is meant for, and fails if it is not found. */
async function plantAll(browser, server, { dataset, client, made, job, drawn }) {
  let failures = 0;
  for (const fault of FAULTS.filter(({ dataset: name, draw }) => name === dataset.name && (drawn || !draw))) {
    const folder = `${dataset.name}-broken`;
    plant(fault, join(OUT, "data", dataset.name), join(OUT, "data", folder));
    const broken = { ...job, draw: fault.draw ?? false, url: job.url.replace(dataset.name, folder) };
    const { lines } = await check(browser, server, { dataset, client, made, job: broken });
    const found = lines.some((line) => fault.found.test(line));
    failures += report(`  planted in it: ${fault.what}`, found ? [] : ["was not found", ...lines]);
  }
  return failures;
}

main().catch((error) => {
  // one line: laz-perf would print its own source with an error that nobody catches
  console.error(`error: ${error.message}`);
  process.exitCode = 1;
});
