// Where the eye is. The picture's coordinates are relative to the eye, so that matrices hold rotations only.

import { add, center, cross, distance, dot, length, multiply, scale, sub, unit } from "pm/math.js";

const UP = [0, 0, 1];

export class Camera {
  constructor() {
    this.eye = [0, -1, 0];
    this.target = [0, 0, 0];
    /** Vertical field of view, degrees. */
    this.fov = 60;
    this.width = 1;
    this.height = 1;
    this.near = 0.1;
    this.far = 1000;
    this.update();
  }

  /** Right, up and backward, and the matrices, after a change. */
  update() {
    const back = unit(sub(this.eye, this.target), [0, 0, 1]);
    // straight down, north is up
    const side = cross(UP, back);
    const right = length(side) > 1e-9 ? unit(side) : [1, 0, 0];
    const up = cross(back, right);
    Object.assign(this, { right, up, back });
    /** Pixels that one unit at the distance 1 covers. */
    this.focal = this.height / (2 * Math.tan((this.fov * Math.PI) / 360));
    const f = (2 * this.focal) / this.height;
    const [n, d] = [this.near, this.far];
    this.projection = [
      (f * this.height) / this.width, 0, 0, 0, 0, f, 0, 0, 0, 0, (d + n) / (n - d), -1, 0, 0, (2 * d * n) / (n - d), 0,
    ];
    this.rotation = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, 0, 0, 0, 1];
    this.matrix = multiply(this.projection, this.rotation);
    this.planes = this.#planes();
  }

  /** The least and the largest depth of what is drawn, from the boxes of all datasets. */
  setRange(boxes) {
    let far = 0;
    let near = Infinity;
    for (const box of boxes) {
      let [least, most] = [Infinity, -Infinity];
      for (let corner = 0; corner < 8; corner++) {
        const at = [0, 1, 2].map((a) => (corner & (1 << a) ? box.max : box.min)[a]);
        const depth = -dot(sub(at, this.eye), this.back);
        least = Math.min(least, depth);
        most = Math.max(most, depth);
      }
      near = Math.min(near, least);
      far = Math.max(far, most);
    }
    this.far = far > 0 ? far * 1.01 : 1;
    // depth is a float of 32 bits: a ratio of 10^5 leaves steps far below a pixel
    this.near = Math.max(near * 0.99, this.far * 1e-5, 1e-9);
    if (this.near >= this.far) this.near = this.far / 2;
    this.update();
  }

  /** (a, b, c, d), inside where a·x + b·y + c·z + d ≥ 0 of a place relative to the eye. */
  #planes() {
    const m = this.matrix;
    const row = (i) => [m[i], m[4 + i], m[8 + i], m[12 + i]];
    const w = row(3);
    const planes = [];
    for (let i = 0; i < 2; i++) {
      const r = row(i);
      planes.push(w.map((x, k) => x + r[k]), w.map((x, k) => x - r[k]));
    }
    planes.push([-this.back[0], -this.back[1], -this.back[2], 0]); // in front of the eye
    return planes;
  }

  /** False if no point of the box can be in the picture. */
  sees(box) {
    return this.planes.every(([a, b, c, d]) => {
      const corner = [a, b, c].map((k, i) => (k > 0 ? box.max[i] : box.min[i]) - this.eye[i]);
      return a * corner[0] + b * corner[1] + c * corner[2] + d >= 0;
    });
  }

  /** Radius, in pixels, of the sphere around a box; Infinity from inside. */
  pixels(box) {
    const radius = distance(box.min, box.max) / 2;
    const away = distance(center(box), this.eye);
    return away <= radius ? Infinity : (radius * this.focal) / away;
  }

  /** Pixel of a place; nothing if it is behind the eye. */
  project(place) {
    const p = sub(place, this.eye);
    const depth = -dot(p, this.back);
    if (!(depth > this.near * 0.1)) return null;
    const k = this.focal / depth;
    return [this.width / 2 + dot(p, this.right) * k, this.height / 2 - dot(p, this.up) * k, depth];
  }

  /** Direction through a pixel, of length 1. */
  ray(x, y) {
    const sideways = scale(this.right, x - this.width / 2);
    const upwards = scale(this.up, this.height / 2 - y);
    return unit(sub(add(sideways, upwards), scale(this.back, this.focal)));
  }

  /** All of the box in sight and no farther, from where the camera looks, or from `from` (direction towards the eye). */
  fit(box, from = this.back) {
    this.target = center(box);
    this.eye = add(this.target, from);
    this.update();
    const upwards = Math.tan((this.fov * Math.PI) / 360) * 0.95;
    const sideways = (upwards * this.width) / this.height;
    // a box without extent is looked at from a place that doubles can tell from it
    let away = Math.max(1e-9 * length(this.target), 1e-6);
    for (let corner = 0; corner < 8; corner++) {
      const at = sub([0, 1, 2].map((a) => (corner & (1 << a) ? box.max : box.min)[a]), this.target);
      const depth = dot(at, this.back);
      away = Math.max(away, depth + Math.abs(dot(at, this.right)) / sideways, depth + Math.abs(dot(at, this.up)) / upwards);
    }
    this.eye = add(this.target, scale(this.back, away));
    this.update();
  }
}

/** Directions towards the eye. */
export const VIEWS = {
  top: [0, 0, 1],
  bottom: [0, 0, -1],
  north: [0, 1, 0],
  south: [0, -1, 0],
  east: [1, 0, 0],
  west: [-1, 0, 0],
  fit: [0.55, -0.7, 0.5],
};
