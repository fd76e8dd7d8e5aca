// Quantised batches: bits by projected size, points by continuous level of detail (docs/formats/batches.md, "What renderers do
// with it"). What is loaded of a batch are its levels of detail, each with as many planes as a picture needed so far.

import { Heap, distances, sub } from "pm/math.js";
import { batchBlock } from "pm/clouds/block.js";
import { pending, together } from "pm/clouds/loader.js";
import { drop, isCurrent, put, renew } from "pm/clouds/units.js";

const REQUEST_POINTS = 150_000;
const FIRST_REQUEST_POINTS = 100_000;
const LODS = 4;
/** Points of a batch; the first of slot s has the storage index s times that. */
const BATCH_POINTS = 10240;

/** Distance between points that cover a box as a surface does, world units. */
function surfaceSpacing(box, points) {
  const sides = sub(box.max, box.min).sort((a, b) => a - b);
  return Math.sqrt((Math.max(sides[1], sides[2] * 1e-3) * sides[2]) / Math.max(points, 1));
}

export class BatchesCloud {
  constructor(gl, source, scene, slots) {
    Object.assign(this, { gl, source, scene, box: scene.bounds, visible: [], shown: 0, frame: 0, pending: 0 });
    /** Factor of the continuous level of detail: a larger one draws fewer points; 0 draws all. */
    this.clod = 1;
    /** 0: by size. */
    this.bits = 0;
    this.mostPlanes = scene.planes;
    // without levels all points are one part
    this.hasParts = scene.lods;
    this.classes = new Set();
    this.slots = slots.map((slot) => {
      const counts = this.hasParts ? slot.lods.map((n, lod) => n - (lod > 0 ? slot.lods[lod - 1] : 0)) : [slot.points];
      const parts = counts.map((size, lod) => ({ slot, lod, size, state: size > 0 ? "new" : "ready", planes: 0, used: 0 }));
      return { ...slot, parts };
    });
  }

  /** Bits that leave an error of half a pixel at most. */
  bitsFor(box, camera) {
    if (this.bits > 0) return Math.min(this.bits, 10 * this.mostPlanes);
    const side = Math.max(...sub(box.max, box.min));
    const away = Math.max(distances(box, camera.eye)[0], camera.near);
    for (const bits of [10, 20]) {
      if (((side / 2 ** (bits + 1)) * camera.focal) / away <= 0.5) return Math.min(bits, 10 * this.mostPlanes);
    }
    return 10 * this.mostPlanes;
  }

  /** The finest level that the nearest point of a box can show. */
  #finest(box, camera) {
    if (!this.scene.lods || this.clod === 0) return LODS - 1;
    const t = (distances(box, camera.eye)[0] * this.clod) / 1000;
    return t > 0 ? Math.min(LODS - 1, Math.floor(Math.log2(this.scene.cell / t))) : LODS - 1;
  }

  update(camera, budget, loader) {
    this.frame++;
    const heap = new Heap();
    for (const slot of this.slots) {
      if (!camera.sees(slot.box)) continue;
      slot.bits = this.bitsFor(slot.box, camera);
      slot.pixels = Math.min(camera.pixels(slot.box), 1e9);
      slot.finest = this.hasParts ? this.#finest(slot.box, camera) : 0;
      if (slot.finest >= 0) heap.push(slot.pixels + (this.hasParts ? 1e12 : 0), { slot, lod: 0 });
    }
    let total = 0;
    const wanted = [];
    this.visible = [];
    this.shown = 0;
    while (heap.size > 0) {
      const { slot, lod } = heap.pop();
      const part = slot.parts[lod];
      total += part.size;
      if (total > budget && this.shown > 0) break;
      part.used = this.frame;
      const isWanted = part.size > 0 && (part.planes * 10 < slot.bits || !isCurrent(part, this.attribute));
      part.goal = slot.bits / 10;
      if (part.block) {
        part.owner = slot;
        part.number = this.visible.length;
        this.visible.push(part);
        this.shown += part.block.count;
      }
      if (isWanted && part.state !== "loading" && part.state !== "failed") wanted.push(part);
      if (lod + 1 < slot.parts.length && lod < slot.finest) heap.push(slot.pixels / 2 ** (lod + 1), { slot, lod: lod + 1 });
    }
    this.#load(wanted, loader);
    this.forget(budget);
    this.isLoading = wanted.length > 0 || this.pending > 0;
  }

  #load(wanted, loader) {
    while (wanted.length > 0 && !loader.isFull) {
      const { lod, goal } = wanted[0];
      const alike = wanted.filter((part) => part.lod === lod && part.goal === goal);
      const parts = together(alike, this.shown === 0 ? FIRST_REQUEST_POINTS : REQUEST_POINTS, this.source.mostBatches);
      const chosen = new Set(parts);
      const rest = wanted.filter((part) => !chosen.has(part));
      wanted.splice(0, wanted.length, ...rest);
      const attribute = this.attribute;
      const lods = this.hasParts ? [lod, lod] : [0, 255];
      const request = async () => {
        const all = await this.source.batches(parts.map((part) => part.slot.unit), { planes: goal, lods, attribute });
        all.forEach((points, i) => {
          put(parts[i], batchBlock(this.gl, points), attribute, this.attribute);
          parts[i].planes = points.planes.length;
          if (attribute === "classification" && attribute === this.attribute) this.#meet(points.extra);
        });
      };
      loader.run(parts, () => pending(this, request));
    }
  }

  #meet(values) {
    const base = this.extraBase ?? 0;
    for (const value of values ?? []) this.classes.add(Math.round(value + base) & 255);
  }

  forget(budget) {
    const loaded = this.slots.flatMap((slot) => slot.parts.filter((part) => part.block));
    let total = loaded.reduce((sum, part) => sum + part.block.count, 0);
    if (total <= 3 * budget) return;
    // of slots in sight the levels that this view has no use for go, too
    loaded.sort((a, b) => a.used - b.used);
    for (const part of loaded) {
      if (total <= 2 * budget || part.used === this.frame) break;
      total -= part.block.count;
      drop(part);
      part.planes = 0;
    }
  }

  setAttribute(attribute) {
    if (attribute === this.attribute) return;
    this.attribute = attribute;
    renew(this.slots.flatMap((slot) => slot.parts), attribute);
  }

  draws(camera) {
    const drawn = new Map();
    for (const part of this.visible) drawn.set(part.owner, (drawn.get(part.owner) ?? 0) + part.block.count);
    return this.visible.map((part) => ({
      spacing: surfaceSpacing(part.owner.box, drawn.get(part.owner)),
      block: part.block,
      unit: part.number,
      level: part.lod,
      bits: Math.min(part.owner.bits, 10 * part.planes),
      start: part.slot.unit * BATCH_POINTS,
      boxMin: sub(part.block.min, camera.eye),
      sides: part.block.sides,
      clod: this.scene.lods ? this.clod : 0,
      cell: this.scene.cell,
    }));
  }

  boxes() {
    return this.visible.filter((part) => part.lod === 0).map((part) => ({ box: part.slot.box, level: part.owner.bits / 10 }));
  }

  unitOf(number, index) {
    const part = this.visible[number];
    return part && { unit: part.slot.unit, index: part.block.indices[index] };
  }

  get bytes() {
    return this.slots.reduce((sum, slot) => sum + slot.parts.reduce((all, part) => all + (part.block?.bytes ?? 0), 0), 0);
  }
}
