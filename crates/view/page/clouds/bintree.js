// A binary tree of tight boxes: all points are in leaves, far ones are a pixel, near ones discs of a size in the world. Leaves
// are thinned where the budget is short.

import { Heap, distances } from "pm/math.js";
import { pending, together } from "pm/clouds/loader.js";
import { drop, isCurrent, putPoints, renew } from "pm/clouds/units.js";

/** Every how manyth point: what comes first, what it is refined to. Of large trees even fewer come first. */
const STEPS = [16, 4, 1];
const MOST_COARSE_POINTS = 100_000;
const REQUEST_POINTS = 150_000;
const FIRST_REQUEST_POINTS = 100_000;

export const MATERIAL = { PLAIN: 0, FAR: 1, NEAR: 2 };

export class BintreeCloud {
  constructor(gl, source, scene, leaves) {
    Object.assign(this, { gl, source, scene, box: scene.bounds, visible: [], shown: 0, frame: 0, pending: 0 });
    this.steps = [...STEPS];
    while (leaves.reduce((sum, leaf) => sum + leaf.points, 0) / this.steps[0] > MOST_COARSE_POINTS) this.steps.unshift(4 * this.steps[0]);
    this.leaves = leaves.map((leaf) => ({ ...leaf, state: "new", at: -1, used: 0 }));
    /** Numbers of the classes that were met. */
    this.classes = new Set();
    /** Radius of a disc of the near material, world units; 0: all points are far. */
    this.radius = 0;
  }

  /** D_T of the paper: beyond it a disc is less than a pixel. */
  switchDistance(camera) {
    return this.radius / Math.tan((camera.fov * Math.PI) / 180 / camera.height);
  }

  update(camera, budget, loader) {
    this.frame++;
    const heap = new Heap();
    for (const leaf of this.leaves) {
      if (!camera.sees(leaf.box)) continue;
      leaf.used = this.frame;
      leaf.goal = -1;
      heap.push(Infinity, { leaf, to: 0 });
    }
    // all leaves coarsely, then the largest in the picture finer
    let total = 0;
    this.visible = [];
    this.shown = 0;
    while (heap.size > 0) {
      const { leaf, to } = heap.pop();
      const before = leaf.goal < 0 ? 0 : Math.ceil(leaf.points / this.steps[leaf.goal]);
      total += Math.ceil(leaf.points / this.steps[to]) - before;
      if (total > budget && to > 0) break;
      leaf.goal = to;
      const pixels = camera.pixels(leaf.box);
      const pointsPerPixel = leaf.points / this.steps[to] / Math.max(pixels * pixels, 1);
      if (to + 1 < this.steps.length && pointsPerPixel < 4) heap.push(1 / pointsPerPixel, { leaf, to: to + 1 });
    }
    const wanted = [];
    for (const leaf of this.leaves) {
      if (leaf.used !== this.frame) continue;
      if (leaf.block) {
        leaf.number = this.visible.length;
        this.visible.push(leaf);
        this.shown += leaf.block.count;
      }
      const isWanted = leaf.goal > leaf.at || !isCurrent(leaf, this.attribute);
      if (isWanted && leaf.state !== "loading" && leaf.state !== "failed") wanted.push(leaf);
    }
    wanted.push(...this.#tooFine(camera, budget));
    this.#load(wanted, camera, loader);
    this.forget(budget);
    this.isLoading = wanted.length > 0 || this.pending > 0;
  }

  /** Leaves that were loaded for a nearer view, the smallest first, as many as are over the budget: they come again, coarser. */
  #tooFine(camera, budget) {
    const found = [];
    let shown = this.shown;
    const finer = this.visible.filter((leaf) => leaf.at > leaf.goal && leaf.goal >= 0);
    for (const leaf of finer.sort((a, b) => camera.pixels(a.box) - camera.pixels(b.box))) {
      if (shown <= budget) break;
      shown -= leaf.block.count - Math.ceil(leaf.points / this.steps[leaf.goal]);
      if (leaf.state === "ready") found.push(leaf);
    }
    return found;
  }

  #load(wanted, camera, loader) {
    const weight = (leaf) => (leaf.at < 0 ? 1e12 : 0) + Math.min(camera.pixels(leaf.box), 1e9);
    wanted.sort((a, b) => weight(b) - weight(a));
    while (wanted.length > 0 && !loader.isFull) {
      const to = wanted[0].goal;
      const alike = wanted.filter((leaf) => leaf.goal === to);
      for (const leaf of alike) leaf.size = Math.ceil(leaf.points / this.steps[to]);
      const units = together(alike, this.shown === 0 ? FIRST_REQUEST_POINTS : REQUEST_POINTS, this.source.mostUnits);
      for (const leaf of units) wanted.splice(wanted.indexOf(leaf), 1);
      const attribute = this.attribute;
      const request = async () => {
        const all = await this.source.points(units.map((leaf) => leaf.unit), { attribute, every: this.steps[to] });
        all.forEach((points, i) => {
          putPoints(this, units[i], points, attribute);
          units[i].at = to;
        });
      };
      loader.run(units, () => pending(this, request));
    }
  }

  forget(budget) {
    const loaded = this.leaves.filter((leaf) => leaf.block);
    let total = loaded.reduce((sum, leaf) => sum + leaf.block.count, 0);
    if (total <= 3 * budget) return;
    loaded.sort((a, b) => a.used - b.used);
    for (const leaf of loaded) {
      if (total <= 2 * budget || leaf.used === this.frame) break;
      total -= leaf.block.count;
      drop(leaf);
      leaf.at = -1;
    }
  }

  setAttribute(attribute) {
    if (attribute === this.attribute) return;
    this.attribute = attribute;
    renew(this.leaves, attribute);
  }

  /** Leaves that both materials concern are drawn twice. */
  draws(camera) {
    const limit = this.switchDistance(camera);
    return this.visible.flatMap((leaf) => {
      const draw = { block: leaf.block, unit: leaf.number, level: this.steps.length - leaf.at, row: -1, cubeMin: [0, 0, 0], side: 1, limit };
      const [near, far] = distances(leaf.box, camera.eye);
      if (this.radius === 0) return [{ ...draw, material: MATERIAL.PLAIN }];
      if (near > limit) return [{ ...draw, material: MATERIAL.FAR }];
      if (far <= limit) return [{ ...draw, material: MATERIAL.NEAR }];
      return [{ ...draw, material: MATERIAL.FAR }, { ...draw, material: MATERIAL.NEAR }];
    });
  }

  boxes() {
    return this.visible.map((leaf) => ({ box: leaf.box, level: leaf.at }));
  }

  unitOf(number, index) {
    const leaf = this.visible[number];
    return leaf && { unit: leaf.unit, index: index * this.steps[leaf.at] };
  }

  get bytes() {
    return this.leaves.reduce((sum, leaf) => sum + (leaf.block?.bytes ?? 0), 0);
  }
}
