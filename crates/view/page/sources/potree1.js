// Potree 1.5 to 1.8 with binary nodes, as pointmill writes them (docs/formats/potree1.md).

import { column, everything, makePoints, sizeOf, usual } from "pm/sources/columns.js";
import { readBytes, readText } from "pm/sources/files.js";

/** Attributes of 1.7, which are words: name here, type, elements. */
const WORDS = {
  POSITION_CARTESIAN: ["position", "int32", 3], COLOR_PACKED: ["rgba", "uint8", 4], RGBA_PACKED: ["rgba", "uint8", 4], RGB_PACKED: ["rgb", "uint8", 3],
  INTENSITY: ["intensity", "uint16", 1], CLASSIFICATION: ["classification", "uint8", 1], RETURN_NUMBER: ["return number", "uint8", 1],
  NUMBER_OF_RETURNS: ["number of returns", "uint8", 1], SOURCE_ID: ["point source id", "uint16", 1], GPS_TIME: ["gps-time", "double", 1],
  NORMAL_SPHEREMAPPED: ["normal spheremapped", "uint8", 2], NORMAL_OCT16: ["normal oct16", "uint8", 2], NORMAL: ["normal", "float", 3],
  NORMAL_FLOATS: ["normal", "float", 3], FILLER_1B: [null, "uint8", 1],
};
/** Names of 1.8 that are other ones here. */
const NAMES = { POSITION_CARTESIAN: "position", RGBA: "rgba", "source id": "point source id" };
const RECORD = 5;

const box = ({ lx, ly, lz, ux, uy, uz }) => ({ min: [lx, ly, lz], max: [ux, uy, uz] });

export class Potree1Source {
  constructor({ name, url }) {
    Object.assign(this, { name, url, counts: new Map() });
  }

  async scene() {
    const meta = JSON.parse(await readText(`${this.url}cloud.js`));
    if (!Array.isArray(meta.pointAttributes)) throw new Error(`${this.name}: nodes are ${meta.pointAttributes} files: use \`pointmill view\``);
    if (!meta.hierarchyStepSize) throw new Error(`${this.name}: version ${meta.version} has no index of its own: use \`pointmill view\``);
    this.meta = meta;
    this.cube = box(meta.boundingBox);
    let at = 0;
    this.columns = meta.pointAttributes.map((own) => {
      const [name, type, elements] = typeof own === "string" ? (WORDS[own] ?? []) : [NAMES[own.name] ?? own.name, own.type, own.elements ?? own.numElements];
      if (!sizeOf(type)) throw new Error(`${this.name}: attributes ${own.name ?? own} are not known: use \`pointmill view\``);
      const made = { name, type, elements, at, min: own.min, max: own.max };
      at += elements * sizeOf(type);
      return made;
    });
    this.stride = at;
    this.attributes = this.columns.filter(({ name }) => name && name !== "position");
    return {
      kind: "octree", format: `Potree ${meta.version}`, name: meta.pointmill?.name ?? this.name, points: meta.points ?? null, projection: meta.projection ?? "",
      cube: this.cube, spacing: meta.spacing, bounds: meta.tightBoundingBox ? box(meta.tightBoundingBox) : this.cube,
      colour: this.attributes.some(({ name }) => name === "rgb" || name === "rgba"), attributes: this.attributes,
    };
  }

  /** The file of a node: complete groups of digits are folders. */
  #path(name, ending) {
    const step = this.meta.hierarchyStepSize;
    const digits = name.slice(1);
    const folders = Array.from({ length: Math.floor(digits.length / step) }, (_, i) => `${digits.slice(i * step, (i + 1) * step)}/`);
    return `${this.url}${this.meta.octreeDir}/r/${folders.join("")}${name}.${ending}`;
  }

  async chunk(root) {
    const view = new DataView(await readBytes(this.#path(root, "hrc")));
    const step = this.meta.hierarchyStepSize;
    const nodes = [{ name: root }];
    for (let i = 0; i < Math.floor(view.byteLength / RECORD) && i < nodes.length; i++) {
      const node = nodes[i];
      const mask = view.getUint8(i * RECORD);
      const isBorder = node.name.length - root.length === step;
      Object.assign(node, { points: view.getUint32(i * RECORD + 1, true), isProxy: isBorder && mask !== 0 });
      this.counts.set(node.name, node.points);
      for (let child = 0; child < 8 && !isBorder; child++) if ((mask >> child) & 1) nodes.push({ name: node.name + child });
    }
    if (nodes.some((node) => node.points === undefined)) throw new Error(`the index below ${root} is cut short`);
    return nodes;
  }

  /** Lower corner of a node's own box: its positions are relative to it. */
  #corner(name) {
    const { min, max } = this.cube;
    const corner = [...min];
    let side = max[0] - min[0];
    for (const digit of name.slice(1)) {
      side /= 2;
      [4, 2, 1].forEach((bit, a) => (corner[a] += Number(digit) & bit ? side : 0));
    }
    return corner;
  }

  async #node(name) {
    const bytes = await readBytes(this.#path(name, "bin"));
    if (bytes.byteLength % this.stride !== 0) throw new Error(`node ${name} is cut short`);
    const view = new DataView(bytes);
    const find = (wanted) => {
      const own = this.columns.find((each) => each.name === wanted);
      return own && column(view, own.type, own.at, this.stride);
    };
    return [bytes.byteLength / this.stride, find];
  }

  async points(units, { attribute }) {
    const scale = [0, 0, 0].fill(this.meta.scale);
    return Promise.all(
      units.map(async (name) => {
        const [count, find] = await this.#node(name);
        return makePoints(count, { integer: find("position"), scale, offset: this.#corner(name), ...usual(this.attributes, find, attribute) });
      }),
    );
  }

  async point(unit, index) {
    const [, find] = await this.#node(unit);
    const [stored, corner] = [find("position"), this.#corner(unit)];
    return everything([0, 1, 2].map((a) => corner[a] + stored(index, a) * this.meta.scale), this.attributes, find, index);
  }
}
