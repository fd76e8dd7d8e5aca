// Mean-split binary trees (docs/formats/bintree.md).

import { column, everything, makePoints, usual } from "pm/sources/columns.js";
import { RangedFile, readText } from "pm/sources/files.js";

export class BintreeSource {
  constructor({ name, url }, messages) {
    Object.assign(this, { name, url, messages });
    this.packed = new RangedFile(`${url}leaves.bin`, messages);
  }

  async scene() {
    const index = JSON.parse(await readText(`${this.url}index.json`));
    if (!Array.isArray(index.nodes)) throw new Error(`${this.name}: index.json has no list of nodes`);
    this.index = index;
    this.attributes = index.attributes
      .filter(({ name }) => !["x", "y", "z"].includes(name))
      .map((own) => ({ ...own, scale: own.scale, offset: own.shift, at: own.offset }));
    const root = index.nodes[0];
    return {
      kind: "bintree", format: "Binary tree", name: index.name || this.name, points: index.points, projection: index.projection ?? "",
      bounds: root ? { min: root.min, max: root.max } : { min: [0, 0, 0], max: [0, 0, 0] },
      colour: this.attributes.some(({ name }) => name === "rgb" || name === "rgba"),
      attributes: this.attributes,
    };
  }

  boxes() {
    return this.index.nodes.flatMap((node, unit) =>
      node.children ? [] : [{ unit, box: { min: node.min, max: node.max }, points: node.count, lods: [0, 0, 0, 0] }],
    );
  }

  async #bytes(leaves) {
    const { stride, layout } = this.index;
    if (layout === "packed") return this.packed.readAll(leaves.map(({ start, count }) => [start, start + count * stride]));
    return Promise.all(leaves.map(({ file, count }) => new RangedFile(`${this.url}${file}`, this.messages).read(0, count * stride)));
  }

  #find(bytes) {
    const view = new DataView(bytes);
    return (name) => {
      const own = this.index.attributes.find((each) => each.name === name);
      return own && column(view, own.type, own.offset, this.index.stride);
    };
  }

  #world(find, { center }) {
    const axes = ["x", "y", "z"].map(find);
    return (i, a) => center[a] + axes[a](i);
  }

  async points(units, { attribute, every }) {
    const leaves = units.map((unit) => this.index.nodes[unit]);
    return (await this.#bytes(leaves)).map((bytes, i) => {
      const find = this.#find(bytes);
      return makePoints(leaves[i].count, { every, world: this.#world(find, leaves[i]), ...usual(this.attributes, find, attribute) });
    });
  }

  async point(unit, index) {
    const leaf = this.index.nodes[unit];
    const find = this.#find((await this.#bytes([leaf]))[0]);
    const world = this.#world(find, leaf);
    return everything([0, 1, 2].map((a) => world(index, a)), this.attributes, find, index);
  }
}
