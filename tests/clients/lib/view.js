// `pointmill view` in the browser: its page opens without a complaint, and its server knows every node (docs/view.md, "Protocol").

import { spawn } from "node:child_process";
import { once } from "node:events";
import { BINARY } from "./pointmill.js";

const INTERRUPTED = 130; // the exit code after Ctrl-C
const PATIENCE = 20_000; // milliseconds until the server listens, and until the page is quiet

/** Starts the server of datasets. `stop()` ends it as Ctrl-C does and returns what is wrong with its end. */
export async function start(...paths) {
  const child = spawn(BINARY, ["view", ...paths, "--no-open", "--json", "--quiet"]);
  let said = "";
  child.stderr.on("data", (part) => (said += part));
  const ended = once(child, "exit");
  const stop = async () => {
    child.kill("SIGINT");
    const [code, signal] = await ended;
    return code === INTERRUPTED ? [] : [`pointmill view ended with ${code ?? signal}: ${said}`];
  };
  const timer = setTimeout(() => child.kill(), PATIENCE);
  let text = "";
  for await (const part of child.stdout.iterator({ destroyOnReturn: false })) {
    text += part;
    if (text.trimEnd().endsWith("}")) break; // the one object that it prints
  }
  clearTimeout(timer);
  if (text === "") throw new Error([...(await stop()), "no address was printed"][0]);
  return { url: JSON.parse(text).url, stop };
}

/** Runs in the page: all nodes that the server tells of, chunk by chunk. */
async function walk() {
  const scene = await (await fetch("api/0/scene")).json();
  let [nodes, points, depth] = [0, 0, 0];
  const chunks = ["r"];
  while (chunks.length > 0) {
    const root = chunks.pop();
    const view = new DataView(await (await fetch(`api/0/nodes?of=${root}`)).arrayBuffer());
    const names = [root];
    for (let i = 0; i < view.getUint32(4, true); i++) {
      const at = 8 + 8 * i;
      const [name, mask, proxy] = [names[i], view.getUint8(at + 4), view.getUint8(at + 5) & 1];
      if (proxy) {
        chunks.push(name);
        continue;
      }
      nodes += 1;
      points += view.getUint32(at, true);
      depth = Math.max(depth, name.length - 1);
      for (let child = 0; child < 8; child++) if (mask & (1 << child)) names.push(name + child);
    }
  }
  return { scene, nodes, points, depth };
}

/**
 * Opens the dataset at `path` and returns `{ lines, figures }`: what is wrong, compared with `made` as run.js describes it, and what
 * it took. `screenshot` is a path.
 */
export async function checkView(context, path, { expected, validated, levels }, screenshot) {
  let server;
  try {
    server = await start(path);
  } catch (error) {
    return { lines: [error.message.trim()], figures: "" };
  }
  const page = await context.newPage();
  const lines = [];
  let [requests, bytes] = [0, 0];
  page.on("console", (message) => message.type() === "error" && lines.push(`console: ${message.text()}`));
  page.on("pageerror", (error) => lines.push(`exception: ${error.message}`));
  page.on("response", (response) => {
    requests += 1;
    bytes += Number(response.headers()["content-length"] ?? 0);
    if (response.status() >= 400) lines.push(`the server answered ${response.status()} to ${response.url()}`);
  });
  try {
    await page.goto(server.url, { waitUntil: "networkidle", timeout: PATIENCE });
    const opened = `${requests} requests, ${(bytes / 1e6).toFixed(1)} MB to open`;
    await page.screenshot({ path: screenshot });
    const { scene, nodes, points, depth } = await page.evaluate(walk);
    const wanted = { nodes: validated.nodes, points: expected.sums.count, depth: levels - 1 };
    for (const [name, found] of Object.entries({ nodes, points, depth })) {
      if (found !== wanted[name]) lines.push(`${name}: ${found}, not ${wanted[name]}`);
    }
    if (scene.points !== wanted.points) lines.push(`points of the scene: ${scene.points}, not ${wanted.points}`);
    if (scene.colour !== expected.names.includes("r")) lines.push(`colour: ${scene.colour}`);
    lines.push(...(await server.stop()));
    return { lines, figures: `${nodes} nodes to level ${depth}, ${opened}` };
  } catch (error) {
    return { lines: [error.message.split("\n")[0], ...lines, ...(await server.stop())], figures: "" };
  } finally {
    await page.close();
  }
}
