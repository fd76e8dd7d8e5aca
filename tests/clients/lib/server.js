// A web server as datasets need it: ranges, right types, and a count of what was asked of it.

import { createReadStream } from "node:fs";
import { stat } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize, sep } from "node:path";

const TYPES = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript; charset=utf-8",
  ".json": "application/json",
  ".wasm": "application/wasm",
};

/**
 * Serves folders on a free port of 127.0.0.1. `roots` maps the first part of a path to a folder. `log` has an entry for
 * each request since `reset()`: `{ path, status, range, bytes }`.
 */
export async function serve(roots) {
  const log = [];
  const server = createServer((request, response) => {
    answer(roots, request, response, log).catch((error) => response.destroy(error));
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return {
    url: `http://127.0.0.1:${server.address().port}`,
    log,
    reset: () => (log.length = 0),
    close: () => new Promise((resolve) => (server.closeAllConnections(), server.close(resolve))),
  };
}

async function answer(roots, request, response, log) {
  const entry = { path: decodeURIComponent(new URL(request.url, "http://host").pathname), status: 404, range: request.headers.range, bytes: 0 };
  log.push(entry);
  const end = (status, headers) => {
    entry.status = status;
    response.writeHead(status, headers).end();
  };
  const file = locate(roots, entry.path);
  const found = file && (await stat(file).catch(() => null));
  if (!found?.isFile()) return end(404, {});

  const headers = { "Content-Type": TYPES[extname(file)] ?? "application/octet-stream", "Accept-Ranges": "bytes" };
  const range = parseRange(entry.range, found.size);
  if (range === null) return end(416, { "Content-Range": `bytes */${found.size}` });
  const { start, last } = range;
  entry.bytes = last - start + 1;
  entry.status = entry.range ? 206 : 200;
  if (entry.range) headers["Content-Range"] = `bytes ${start}-${last}/${found.size}`;
  response.writeHead(entry.status, { ...headers, "Content-Length": entry.bytes });
  if (entry.bytes === 0) return response.end();
  createReadStream(file, { start, end: last }).on("error", () => response.destroy()).pipe(response);
}

/** The file of a path, or undefined if it is outside of all roots. */
function locate(roots, path) {
  const [, first, ...rest] = path.split("/");
  const root = roots[first] ?? (rest.length === 0 ? roots[""] : undefined);
  if (root === undefined) return undefined;
  const file = normalize(join(root, roots[first] ? rest.join("/") : first));
  return file.startsWith(normalize(root) + sep) ? file : undefined;
}

/** First and last byte of `bytes=a-b`, of the whole file without a header, or null if there is no such byte. */
function parseRange(header, size) {
  if (header === undefined) return { start: 0, last: size - 1 };
  const [, from, to] = /^bytes=(\d*)-(\d*)$/.exec(header) ?? [];
  if (from === undefined || (from === "" && to === "")) return null;
  const start = from === "" ? Math.max(0, size - Number(to)) : Number(from);
  const last = from === "" || to === "" ? size - 1 : Math.min(Number(to), size - 1);
  return start <= last && start < size ? { start, last } : null;
}
