// A dataset behind `pointmill view`: the format crate decodes it there.

import { request } from "pm/sources/request.js";
import { readBatches, readBoxes, readNodes, readPoints } from "pm/sources/units.js";

const LOST = "pointmill does not answer: it was stopped, or the connection is gone";

/** The body of an answer; errors say what the server says. */
async function get(url, signal) {
  const { answer, bytes } = await request(url, { lost: LOST, signal });
  if (answer.ok) return bytes;
  const text = new TextDecoder().decode(bytes);
  let said = text;
  try {
    said = JSON.parse(text).error ?? text;
  } catch {
    // not ours: as it is
  }
  throw new Error(said || `status ${answer.status}`);
}

const json = async (bytes) => JSON.parse(new TextDecoder().decode(await bytes));

const query = (fields) =>
  Object.entries(fields)
    .filter(([, value]) => value !== undefined && value !== null && value !== "")
    .map(([key, value]) => `${key}=${encodeURIComponent(value).replaceAll("%2C", ",")}`)
    .join("&");

export class ServerSource {
  /** Units that one request may have. */
  mostUnits = 256;
  mostBatches = 4096;

  constructor(base) {
    this.base = base;
  }

  async scene() {
    return json(get(`${this.base}/scene`));
  }

  async chunk(name) {
    return readNodes(await get(`${this.base}/nodes?${query({ of: name })}`), name);
  }

  async boxes() {
    return readBoxes(await get(`${this.base}/nodes`));
  }

  async points(units, { attribute, every }) {
    const url = `${this.base}/points?${query({ units: units.join(","), attribute, every: every > 1 ? every : undefined })}`;
    return readPoints(await get(url));
  }

  async batches(units, { planes, lods, attribute }) {
    const url = `${this.base}/batches?${query({ units: units.join(","), planes, lods: `${lods[0]}-${lods[1]}`, attribute })}`;
    return readBatches(await get(url));
  }

  /** Everything that is stored of a point. `index` counts the points of the unit as they are stored. `signal` may abort it. */
  async point(unit, index, signal) {
    return json(get(`${this.base}/point?${query({ unit, index })}`, signal));
  }
}
