// Potree 2.0, DEFAULT and BROTLI (docs/formats/potree2.md).

import { column, everything, makePoints, meant, sizeOf, usual } from "pm/sources/columns.js";
import { RangedFile, readText } from "pm/sources/files.js";

const RECORD = 22;
const PROXY = 2;

export class Potree2Source {
  constructor({ name, url }, messages) {
    this.name = name;
    this.url = url;
    this.hierarchy = new RangedFile(`${url}hierarchy.bin`, messages);
    this.octree = new RangedFile(`${url}octree.bin`, messages);
    /** Places of points, and of chunks of the index, by the name of their node. */
    this.nodes = new Map();
    this.chunks = new Map();
  }

  async scene() {
    const meta = JSON.parse(await readText(`${this.url}metadata.json`));
    this.meta = meta;
    if (meta.encoding === "BROTLI") canBrotli();
    // as stored: name, type, elements, byte of a DEFAULT record
    let at = 0;
    this.columns = meta.attributes.map(({ name, type, numElements, min, max, scale, offset }) => {
      const size = numElements * sizeOf(type);
      const made = { name, type, elements: numElements, min, max, scale, offset, at, size };
      at += size;
      return made;
    });
    this.stride = at;
    this.attributes = this.columns.filter(({ name }) => name !== "position").map((own) => ({ ...own, ...meant(own) }));
    const position = this.columns.find(({ name }) => name === "position");
    const cube = meta.boundingBox;
    this.chunks.set("r", { offset: 0, size: meta.hierarchy.firstChunkSize });
    return {
      kind: "octree", format: "Potree 2.0", name: meta.name || this.name, points: meta.points, projection: meta.projection, cube, spacing: meta.spacing,
      bounds: position?.min?.length === 3 ? { min: position.min, max: position.max } : cube,
      colour: this.attributes.some(({ name }) => name === "rgb" || name === "rgba"),
      attributes: this.attributes,
    };
  }

  async chunk(root) {
    const { offset, size } = this.chunks.get(root);
    const bytes = await this.hierarchy.read(offset, offset + size);
    const view = new DataView(bytes);
    const found = [{ name: root }];
    for (let i = 0; i < size / RECORD; i++) {
      const node = found[i];
      if (!node) throw new Error(`the index below ${root} is no tree`);
      const at = i * RECORD;
      const [type, mask] = [view.getUint8(at), view.getUint8(at + 1)];
      Object.assign(node, { points: view.getUint32(at + 2, true), isProxy: type === PROXY });
      const place = { offset: Number(view.getBigUint64(at + 6, true)), size: Number(view.getBigUint64(at + 14, true)), points: node.points };
      (node.isProxy ? this.chunks : this.nodes).set(node.name, place);
      for (let child = 0; child < 8 && !node.isProxy; child++) if ((mask >> child) & 1) found.push({ name: node.name + child });
    }
    if (found.length * RECORD !== size) throw new Error(`the index below ${root} is no tree`);
    return found;
  }

  async points(units, { attribute }) {
    // of a proxy the place of its points stands in its own chunk
    for (const name of units) if (!this.nodes.has(name)) await this.chunk(name);
    const places = units.map((name) => this.nodes.get(name));
    const parts = await this.octree.readAll(places.map(({ offset, size }) => [offset, offset + size]));
    return Promise.all(parts.map((bytes, i) => this.#decode(bytes, places[i].points, attribute)));
  }

  async #columns(bytes, count) {
    if (this.meta.encoding === "BROTLI") return brotliColumns(bytes, count, this.columns);
    if (bytes.byteLength !== count * this.stride) throw new Error(`a node has ${bytes.byteLength} bytes, ${count * this.stride} are right`);
    const view = new DataView(bytes);
    return (name) => {
      const own = this.columns.find((each) => each.name === name);
      return own && column(view, own.type, own.at, this.stride);
    };
  }

  async #decode(bytes, count, attribute) {
    const find = await this.#columns(bytes, count);
    const { scale, offset } = this.meta;
    return makePoints(count, { integer: find("position"), scale, offset, ...usual(this.attributes, find, attribute) });
  }

  async point(unit, index) {
    const { offset, size, points } = this.nodes.get(unit);
    const find = await this.#columns(await this.octree.read(offset, offset + size), points);
    const [stored, meta] = [find("position"), this.meta];
    const position = [0, 1, 2].map((a) => stored(index, a) * meta.scale[a] + meta.offset[a]);
    return everything(position, this.attributes, find, index);
  }
}

function canBrotli() {
  try {
    return new DecompressionStream("brotli");
  } catch {
    throw new Error("This browser does not decompress Brotli for pages: convert with --encoding default, or use `pointmill view`.");
  }
}

async function brotliColumns(bytes, count, columns) {
  const stream = new Blob([bytes]).stream().pipeThrough(canBrotli());
  const raw = await new Response(stream).arrayBuffer();
  const view = new DataView(raw);
  const starts = new Map();
  let at = 0;
  for (const { name, size } of columns) {
    starts.set(name, at);
    at += count * (name === "position" ? 16 : name === "rgb" ? 8 : size);
  }
  if (at !== raw.byteLength) throw new Error(`a node has ${raw.byteLength} bytes, ${at} are right`);
  return (name) => {
    const own = columns.find((each) => each.name === name);
    if (!own) return undefined;
    const start = starts.get(name);
    if (name === "rgb") return (i, c) => every3(view, start + 8 * i, c);
    if (name === "position") {
      // bits 16 to 31 first
      return (i, a) => every3(view, start + 16 * i, a) * 65536 + every3(view, start + 16 * i + 8, a);
    }
    return column(view, own.type, start, own.size);
  };
}

/** 16 bits of every third of 48 bits, from bit `a` on. */
function every3(view, at, a) {
  const [low, high] = [view.getUint32(at, true), view.getUint32(at + 4, true)];
  return compact((low & 0xffffff) >>> a) | (compact((((low >>> 24) | (high << 8)) & 0xffffff) >>> a) << 8);
}

/** Bits 0, 3, … 21 together. */
function compact(x) {
  x &= 0x249249;
  x = (x | (x >>> 2)) & 0x0c30c3;
  x = (x | (x >>> 4)) & 0x00f00f;
  return (x | (x >>> 8)) & 0xff;
}
