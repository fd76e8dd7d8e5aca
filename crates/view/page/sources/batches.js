// Quantised batches without compression (docs/formats/batches.md): planes go to the graphics card as they are.

import { column, everything, meant, sizeOf } from "pm/sources/columns.js";
import { RangedFile } from "pm/sources/files.js";

const HEADER = 256;
const BATCH_POINTS = 10240;
const FLAGS = { LODS: 2, COMPRESSED: 16 };
const RECORD = 32;
/** Sections of a batch that are kept, 40 KiB each. */
const MOST_KEPT = 1500;

/** Points of the levels up to each one: what is usual of a surface; the file says it only point by point. */
const estimate = (points) => [64, 16, 4, 1].map((part) => Math.ceil(points / part));

export class BatchesSource {
  constructor({ name, url }, messages) {
    this.name = name;
    this.kept = new Map();
    this.file = new RangedFile(url.endsWith("/") ? `${url}points.qbatch` : url, messages);
  }

  async scene() {
    const view = new DataView(await this.file.read(0, HEADER));
    const magic = String.fromCharCode(...new Uint8Array(view.buffer, 0, 8));
    if (magic !== "QBATCHES" || view.getUint32(8, true) !== 1) throw new Error(`${this.name}: no quantised batches`);
    const u64 = (at) => Number(view.getBigUint64(at, true));
    const three = (at) => [0, 8, 16].map((k) => view.getFloat64(at + k, true));
    const flags = view.getUint32(112, true);
    if (flags & FLAGS.COMPRESSED) throw new Error(`${this.name}: a page cannot decompress zstd: convert without --compress, or use \`pointmill view\``);
    this.count = u64(16);
    this.slots = view.getUint32(28, true);
    this.origin = three(32);
    const [records, hi, mid, lo] = [120, 128, 136, 144].map(u64);
    this.planes = [hi, mid, lo].filter((at) => at > 0);
    this.lods = (flags & FLAGS.LODS) !== 0;
    this.colour = u64(152);
    const description = await this.file.read(u64(168), u64(168) + u64(176));
    this.about = JSON.parse(new TextDecoder().decode(description));
    this.records = new DataView(await this.file.read(records, records + RECORD * this.slots));
    this.attributes = this.about.attributes.map((own) => {
      const made = { ...own, at: own.offset, scale: own.valueScale, offset: own.valueOffset };
      return { ...made, ...meant(made) };
    });
    return {
      kind: "batches", format: "Quantised batches", name: this.about.name || this.name, points: this.count, projection: this.about.projection ?? "",
      bounds: { min: three(56), max: three(80) }, cell: view.getFloat64(104, true), planes: this.planes.length, batches: this.slots,
      lods: this.lods, colour: this.about.colour !== "none", attributes: this.attributes,
    };
  }

  #record(slot) {
    const [view, at] = [this.records, RECORD * slot];
    const three = (from) => [0, 4, 8].map((k) => view.getFloat32(from + k, true));
    const [min, max] = [three(at), three(at + 16)];
    return { min: min.map((v, a) => v + this.origin[a]), sides: max.map((v, a) => v - min[a]), points: view.getUint32(at + 28, true) };
  }

  boxes() {
    return Array.from({ length: this.slots }, (_, unit) => {
      const { min, sides, points } = this.#record(unit);
      return { unit, box: { min, max: min.map((v, a) => v + sides[a]) }, points, lods: this.lods ? estimate(points) : [points, points, points, points] };
    });
  }

  /** Sections of batches; those of the last ones are kept, for their next level of detail. */
  async #words(at, units, size, make) {
    const missing = units.filter((unit) => !this.kept.has(`${at} ${unit}`));
    const ranges = missing.map((unit) => {
      const start = at + unit * BATCH_POINTS * size;
      return [start, start + this.#record(unit).points * size];
    });
    (await this.file.readAll(ranges)).forEach((bytes, i) => this.kept.set(`${at} ${missing[i]}`, make(bytes)));
    const out = units.map((unit) => this.kept.get(`${at} ${unit}`));
    for (const key of [...this.kept.keys()].slice(0, Math.max(0, this.kept.size - MOST_KEPT))) this.kept.delete(key);
    return out;
  }

  async batches(units, { planes, lods, attribute }) {
    const words = (at) => this.#words(at, units, 4, (bytes) => new Uint32Array(bytes));
    const all = await Promise.all([this.colour, ...this.planes.slice(0, planes)].map(words));
    const extra = attribute ? await this.#extra(attribute, units) : null;
    return units.map((unit, i) => {
      const { min, sides, points } = this.#record(unit);
      const words = all[0][i];
      const indices = Uint16Array.from({ length: points }, (_, k) => k).filter((k) => words[k] >>> 24 >= lods[0] && words[k] >>> 24 <= lods[1]);
      const pick = (values) => values && values.constructor.from(indices, (k) => values[k]);
      const colours = new Uint8Array(pick(words).buffer);
      const chosen = all.slice(1).map((plane) => pick(plane[i]));
      return { count: indices.length, stored: points, planes: chosen, colours, indices, extra: pick(extra?.[i]) ?? null, min, sides };
    });
  }

  async #extra(name, units) {
    const own = this.attributes.find((each) => each.name === name);
    if (!own) return null;
    const size = sizeOf(own.type) * own.elements;
    return this.#words(own.at, units, size, (bytes) => {
      const get = column(new DataView(bytes), own.type, 0, size);
      const base = own.min?.[0] ?? 0;
      return Float32Array.from({ length: bytes.byteLength / size }, (_, i) => get(i) * (own.scale?.[0] ?? 1) + (own.offset?.[0] ?? 0) - base);
    });
  }

  async point(unit, index) {
    const { min, sides } = this.#record(unit);
    const word = async (at) => new DataView(await this.file.read(at + 4 * (unit * BATCH_POINTS + index), at + 4 * (unit * BATCH_POINTS + index) + 4)).getUint32(0, true);
    const planes = await Promise.all(this.planes.map(word));
    const position = [0, 1, 2].map((a) => {
      const t = planes.reduce((sum, plane) => sum * 1024 + ((plane >>> (10 * a)) & 1023), 0);
      return sides[a] === 0 ? min[a] : min[a] + ((t + 0.5) * sides[a]) / 1024 ** planes.length;
    });
    const columns = new Map();
    for (const { name, type, elements, at } of this.attributes) {
      const size = sizeOf(type) * elements;
      const start = at + (unit * BATCH_POINTS + index) * size;
      columns.set(name, column(new DataView(await this.file.read(start, start + size)), type, 0, size));
    }
    const colour = await word(this.colour);
    const made = everything(position, this.attributes, (name) => columns.get(name), 0);
    made.attributes.unshift({ name: "colour", values: [colour & 255, (colour >>> 8) & 255, (colour >>> 16) & 255] });
    return made;
  }
}
