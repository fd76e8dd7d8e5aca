// Chromium without a window, with WebGL by the processor, and pages that keep every complaint.

import { copyFileSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { chromium } from "playwright-core";

const here = dirname(fileURLToPath(import.meta.url));
const require = createRequire(import.meta.url);

/** A folder with a built Potree, which is not published as a package: one of its releases, unpacked. */
export const POTREE = process.env.POTREE;

/** Which three.js each client gets: three-loader asks for ~0.160, the others take the newest. */
const CLIENTS = { "potree-core": "three-current", "three-loader": "three", copc: "three-current", ...(POTREE && { potree: "three-current" }) };

/** Scripts that a page needs beside its own, from the folder of Potree. */
const BEFORE = { potree: ["libs/jquery/jquery-3.1.1.min.js", "libs/proj4/proj4.js", "build/potree/potree.js"] };

const PAGE = (script) => `<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,"><title>${script}</title>
<style>body { margin: 0 }</style><canvas width="640" height="480"></canvas>${(BEFORE[script] ?? []).map((path) => `<script src="/${script}/${path}"></script>`).join("")}<script type="module" src="/${script}.js"></script>`;

/** Makes one script and one page of each client in `folder`, as a bundler does for those who use it. */
export async function bundle(folder) {
  mkdirSync(folder, { recursive: true });
  for (const [client, three] of Object.entries(CLIENTS)) {
    await build({
      entryPoints: [join(here, "../clients", `${client}.js`)],
      outfile: join(folder, `${client}.js`),
      bundle: true,
      format: "esm",
      // the file itself, as packages that are not modules would get a second copy of three.js
      alias: { three: join(here, "../node_modules", three, "build/three.module.js") },
      external: ["fs", "path"], // asked for by copc and laz-perf in node alone
      logLevel: "error",
    });
    writeFileSync(join(folder, `${client}.html`), PAGE(client));
  }
  copyFileSync(join(dirname(require.resolve("laz-perf")), "../web/laz-perf.wasm"), join(folder, "laz-perf.wasm"));
}

/** Starts the browser; `BROWSER` names another program than Debian's. */
export async function startBrowser() {
  const profile = mkdtempSync(join(tmpdir(), "pointmill-clients-"));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath: process.env.BROWSER ?? "/usr/bin/chromium",
    headless: true,
    args: [
      "--no-sandbox", // CI runs as root
      "--use-gl=angle",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
      "--disable-quic",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
    ],
  });
  const close = async () => {
    await context.close();
    rmSync(profile, { recursive: true, force: true, maxRetries: 5 }); // processes may still write
  };
  return { context, close };
}

/** What Chromium says of its own software rendering, and not of the page. */
const OWN = /GL Driver Message.*ReadPixels|Automatic fallback to software WebGL/;

/**
 * Opens `url`, calls `window.run(job)` there, and returns its result with `complaints`: errors and warnings of the console, of
 * scripts and of requests. Fails after `seconds`. `screenshot` is a path, or undefined.
 */
export async function runPage(context, url, job, { seconds, screenshot }) {
  const page = await context.newPage();
  const complaints = [];
  page.on("console", (message) => {
    if (["error", "warning"].includes(message.type()) && !OWN.test(message.text())) complaints.push(`${message.type()}: ${message.text()}`);
  });
  page.on("pageerror", (error) => complaints.push(`exception: ${error.message}`));
  page.on("requestfailed", (request) => complaints.push(`request failed: ${request.url()}`));
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`not done within ${seconds} s`)), 1000 * seconds);
  });
  try {
    await page.goto(url);
    await page.waitForFunction(() => "run" in window, undefined, { timeout: 1000 * seconds });
    const result = await Promise.race([page.evaluate((given) => window.run(given), job), late]);
    if (screenshot) await page.locator("canvas").screenshot({ path: screenshot });
    return { ...result, complaints };
  } catch (error) {
    // what the console said is more often the cause than what was thrown at last
    error.message = [error.message.split("\n")[0].replace(/^page\.\w+: (Error: )?/, ""), ...complaints].join("; ");
    throw error;
  } finally {
    clearTimeout(timer);
    await page.close();
  }
}
