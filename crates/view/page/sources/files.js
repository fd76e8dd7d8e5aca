// Files of a static server, read by ranges.

import { Interrupted, request } from "pm/sources/request.js";

/** Of a server that ignores ranges, files up to this size are read whole. */
const MOST_WHOLE = 64 * 1024 * 1024;
/** Gaps up to this are read with what is around them. */
const MOST_GAP = 32 * 1024;

async function get(url) {
  const { answer, bytes } = await ask(url, { cache: "no-cache" });
  if (!answer.ok) throw new Error(`${url}: the server answers ${answer.status}`);
  return bytes;
}

async function ask(url, options) {
  try {
    return await request(url, { lost: `${url}: the server does not answer`, ...options });
  } catch (error) {
    if (!(error instanceof Interrupted) || location.protocol !== "file:") throw error;
    throw new Error("A browser reads no files beside a page that was opened from the disk: put both on a web server, or use `pointmill view`.");
  }
}

export const readText = async (url) => new TextDecoder().decode(await get(url));
export const readBytes = get;

export class RangedFile {
  constructor(url, messages) {
    Object.assign(this, { url, messages });
  }

  /** Bytes `start` to `end`, exclusive. */
  async read(start, end) {
    if (end <= start) return new ArrayBuffer(0);
    // until the first answer nobody knows whether the server takes ranges: a second request might fetch the whole file again
    if (!this.first) {
      this.first = this.#request(start, end);
      return this.first;
    }
    await this.first.catch(() => undefined);
    return this.whole ? this.#part(start, end) : this.#request(start, end);
  }

  /** Several ranges, with as few requests as make sense; in the order of `ranges`. */
  async readAll(ranges) {
    const order = ranges.map((_, i) => i).sort((a, b) => ranges[a][0] - ranges[b][0]);
    const runs = [];
    for (const i of order) {
      const [start, end] = ranges[i];
      const run = runs.at(-1);
      if (run && start <= run.end + MOST_GAP) {
        run.end = Math.max(run.end, end);
        run.members.push(i);
      } else runs.push({ start, end, members: [i] });
    }
    const out = new Array(ranges.length);
    await Promise.all(
      runs.map(async ({ start, end, members }) => {
        const bytes = await this.read(start, end);
        for (const i of members) out[i] = bytes.slice(ranges[i][0] - start, ranges[i][1] - start);
      }),
    );
    return out;
  }

  #part(start, end) {
    if (end > this.whole.byteLength) throw new Error(`${this.url}: ends at byte ${this.whole.byteLength}, bytes up to ${end} are wanted`);
    return this.whole.slice(start, end);
  }

  async #request(start, end) {
    const accept = (answer) => answer.status === 200 && this.#acceptWhole(answer);
    const { answer, bytes } = await ask(this.url, { headers: { Range: `bytes=${start}-${end - 1}` }, accept });
    if (answer.status === 200) {
      this.whole = bytes;
      return this.#part(start, end);
    }
    if (answer.status === 416) throw new Error(`${this.url}: ends before byte ${end}`);
    if (answer.status !== 206) throw new Error(`${this.url}: the server answers ${answer.status}`);
    if (bytes.byteLength !== end - start) throw new Error(`${this.url}: bytes ${start} to ${end} are not all there`);
    return bytes;
  }

  #acceptWhole(answer) {
    const size = Number(answer.headers.get("content-length") ?? 0);
    const fault = `${location.host} ignores ranges of bytes, as python's http.server does`;
    if (!(size > 0 && size <= MOST_WHOLE)) {
      throw new Error(`${this.url}: ${fault}: use \`pointmill view\`, nginx, Apache or another server that answers 206`);
    }
    this.messages?.note(`${fault}: files are read whole.`);
  }
}
