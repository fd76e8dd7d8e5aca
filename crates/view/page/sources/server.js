// A dataset behind `pointmill view`: the format crate decodes it there.

import { readBatches, readBoxes, readNodes, readPoints } from "pm/sources/units.js";

/** The body of an answer; errors say what the server says. */
async function get(url, signal) {
  let answer;
  try {
    answer = await fetch(url, { signal });
  } catch {
    throw new Error("pointmill does not answer: it was stopped, or the connection is gone");
  }
  if (answer.ok) return answer;
  const text = await answer.text();
  let said = text;
  try {
    said = JSON.parse(text).error ?? text;
  } catch {
    // not ours: as it is
  }
  throw new Error(said || `status ${answer.status}`);
}

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
    return (await get(`${this.base}/scene`)).json();
  }

  async chunk(name) {
    return readNodes(await (await get(`${this.base}/nodes?${query({ of: name })}`)).arrayBuffer(), name);
  }

  async boxes() {
    return readBoxes(await (await get(`${this.base}/nodes`)).arrayBuffer());
  }

  async points(units, { attribute, every }) {
    const url = `${this.base}/points?${query({ units: units.join(","), attribute, every: every > 1 ? every : undefined })}`;
    return readPoints(await (await get(url)).arrayBuffer());
  }

  async batches(units, { planes, lods, attribute }) {
    const url = `${this.base}/batches?${query({ units: units.join(","), planes, lods: `${lods[0]}-${lods[1]}`, attribute })}`;
    return readBatches(await (await get(url)).arrayBuffer());
  }

  /** Everything that is stored of a point. `index` counts the points of the unit as they are stored. */
  async point(unit, index, signal) {
    return (await get(`${this.base}/point?${query({ unit, index })}`, signal)).json();
  }
}
