// An octree with additive levels of detail: a node is drawn with all its ancestors.

import { Heap, scale, sub } from "pm/math.js";
import { pending, together } from "pm/clouds/loader.js";
import { drop, putPoints, renew } from "pm/clouds/units.js";

/** Nodes of smaller radius, in pixels, are not drawn. */
const LEAST_PIXELS = 40;
/** Points of one request; of the first ones fewer, so that there is a picture soon. */
const REQUEST_POINTS = 150_000;
const FIRST_REQUEST_POINTS = 60_000;
/** Nodes in the texture of adaptive sizes. */
const MOST_NODES = 1024 * 64;

export class OctreeCloud {
  constructor(gl, source, scene) {
    Object.assign(this, { gl, source, scene, box: scene.bounds, nodes: new Map(), visible: [], wanted: [], frame: 0 });
    this.root = this.#node("r", scene.cube.min, scene.cube.max[0] - scene.cube.min[0]);
    this.root.isProxy = true;
    this.texture = gl.createTexture();
    this.shown = 0;
  }

  #node(name, min, side) {
    const box = { min, max: min.map((low) => low + side) };
    const node = { name, level: name.length - 1, box, side, points: 0, size: 0, isProxy: false, state: "new", children: [], used: 0 };
    node.chunk = { state: "new" }; // of a proxy
    node.child = name.length > 1 ? Number(name.at(-1)) : 0;
    this.nodes.set(name, node);
    return node;
  }

  /** Puts the nodes of a chunk into the tree. */
  #insert(nodes) {
    for (const { name, points, isProxy } of nodes) {
      let node = this.nodes.get(name);
      if (!node) {
        const parent = this.nodes.get(name.slice(0, -1));
        const child = Number(name.at(-1));
        const half = parent.side / 2;
        const high = [child >> 2, (child >> 1) & 1, child & 1];
        node = this.#node(name, parent.box.min.map((low, a) => low + high[a] * half), half);
        node.parent = parent;
        parent.children.push(node);
      }
      Object.assign(node, { points, size: points, isProxy });
    }
  }

  /** Chooses nodes for a picture; `budget` points at most. */
  update(camera, budget, loader) {
    this.frame++;
    const heap = new Heap();
    heap.push(Infinity, this.root);
    this.visible = [];
    this.shown = 0;
    this.wanted = [];
    const proxies = [];
    let total = 0;
    while (heap.size > 0) {
      const node = heap.pop();
      if (!camera.sees(node.box)) continue;
      if (node.isProxy) {
        proxies.push(node);
        if (node === this.root) continue;
      }
      total += node.points;
      if (total > budget && node !== this.root) break;
      node.used = this.frame;
      // samples of a node lack the points of its ancestors; those that cannot be read are not waited for
      node.isDrawn = (node.parent?.isDrawn ?? true) && (node.block !== undefined || node.points === 0 || node.state === "failed");
      if (node.isDrawn && node.block) {
        node.at = this.visible.length;
        this.visible.push(node);
        this.shown += node.block.count;
      }
      if (node.state === "new" && node.points > 0) this.wanted.push(node);
      for (const child of node.children) {
        const pixels = camera.pixels(child.box);
        if (pixels >= LEAST_PIXELS) heap.push(pixels, child);
      }
    }
    this.#load(proxies, loader);
    this.forget(budget);
    this.isLoading = this.wanted.length > 0 || proxies.some((node) => node.chunk.state === "new") || this.pending > 0;
  }

  pending = 0;
  /** Numbers of the classes that were met. */
  classes = new Set();

  #load(proxies, loader) {
    for (const node of proxies) {
      if (node.chunk.state !== "new") continue;
      const isRunning = loader.run([node.chunk], () => pending(this, async () => this.#insert(await this.source.chunk(node.name))));
      if (!isRunning) return;
    }
    while (this.wanted.length > 0 && !loader.isFull) {
      const most = this.shown === 0 ? FIRST_REQUEST_POINTS : REQUEST_POINTS;
      const units = together(this.wanted, most, this.source.mostUnits);
      this.wanted.splice(0, units.length);
      const attribute = this.attribute;
      const request = async () => {
        const all = await this.source.points(units.map((node) => node.name), { attribute });
        all.forEach((points, i) => putPoints(this, units[i], points, attribute));
      };
      loader.run(units, () => pending(this, request));
    }
  }

  /** Of nodes that were not drawn for long the points go, as soon as there are three times as many as are drawn at once. */
  forget(budget) {
    const loaded = [...this.nodes.values()].filter((node) => node.block);
    let total = loaded.reduce((sum, node) => sum + node.block.count, 0);
    if (total <= 3 * budget) return;
    loaded.sort((a, b) => a.used - b.used);
    for (const node of loaded) {
      if (total <= 2 * budget || node.used === this.frame) break;
      total -= node.block.count;
      drop(node);
    }
  }

  /** Another attribute is wanted beside colours and intensities. */
  setAttribute(attribute) {
    if (attribute === this.attribute) return;
    this.attribute = attribute;
    renew(this.nodes.values(), attribute);
  }

  /** For the shader: which children of each visible node are visible. They stand one behind the other. */
  nodeTable() {
    const { gl } = this;
    const isVisible = new Set(this.visible);
    // the root, and what is below a node that has no points or cannot be read
    const order = this.visible.filter((node) => !isVisible.has(node.parent)).slice(0, MOST_NODES);
    for (const node of this.visible) node.row = -1;
    const entries = new Uint32Array(1024 * Math.max(1, Math.ceil(Math.min(this.visible.length, MOST_NODES) / 1024)));
    for (let i = 0; i < order.length; i++) {
      order[i].row = i;
      const below = order[i].children.filter((child) => isVisible.has(child)).sort((a, b) => a.child - b.child);
      const mask = below.reduce((sum, child) => sum | (1 << child.child), 0);
      entries[i] = (order.length << 8) | mask;
      if (order.length + below.length > MOST_NODES) entries[i] = 0;
      else order.push(...below);
    }
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32UI, 1024, entries.length / 1024, 0, gl.RED_INTEGER, gl.UNSIGNED_INT, entries);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
    return this.texture;
  }

  /** What is drawn, with uniforms of each. */
  draws(camera) {
    return this.visible.map((node) => ({
      block: node.block,
      unit: node.at,
      level: node.level,
      row: node.row ?? -1,
      cubeMin: sub(node.box.min, camera.eye),
      side: node.side,
    }));
  }

  boxes() {
    return this.visible.map((node) => ({ box: node.box, level: node.level }));
  }

  /** Name and stored index of a point that was drawn. */
  unitOf(number, index) {
    const node = this.visible[number];
    return node && { unit: node.name, index, center: scale([0, 1, 2].map((a) => node.box.min[a] + node.box.max[a]), 0.5) };
  }

  get bytes() {
    return [...this.nodes.values()].reduce((sum, node) => sum + (node.block?.bytes ?? 0), 0);
  }
}
