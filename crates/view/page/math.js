// Vectors of three doubles, and 4×4 matrices by columns. World coordinates of 10^7 are subtracted here, in doubles, before
// anything becomes single precision.

export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const scale = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const distance = (a, b) => length(sub(a, b));
export const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

/** Of length 1; `otherwise` if there is no direction. */
export function unit(a, otherwise = [0, 0, 1]) {
  const l = length(a);
  return l > 0 && Number.isFinite(l) ? scale(a, 1 / l) : otherwise;
}

export const center = (box) => scale(add(box.min, box.max), 0.5);

/** The box of all boxes; boxes without points have min > max. */
export function union(boxes) {
  const out = { min: [Infinity, Infinity, Infinity], max: [-Infinity, -Infinity, -Infinity] };
  for (const box of boxes) {
    for (let a = 0; a < 3; a++) {
      out.min[a] = Math.min(out.min[a], box.min[a]);
      out.max[a] = Math.max(out.max[a], box.max[a]);
    }
  }
  return out;
}

/** Nearest and farthest distance from a place to a box. */
export function distances(box, from) {
  let near = 0;
  let far = 0;
  for (let a = 0; a < 3; a++) {
    const gap = Math.max(box.min[a] - from[a], 0, from[a] - box.max[a]);
    const reach = Math.max(Math.abs(from[a] - box.min[a]), Math.abs(from[a] - box.max[a]));
    near += gap * gap;
    far += reach * reach;
  }
  return [Math.sqrt(near), Math.sqrt(far)];
}

/** a · b */
export function multiply(a, b) {
  const out = new Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[k * 4 + row] * b[column * 4 + k];
      out[column * 4 + row] = sum;
    }
  }
  return out;
}

/** Waiting elements, the largest weight first. */
export class Heap {
  #items = [];

  get size() {
    return this.#items.length;
  }

  push(weight, item) {
    const items = this.#items;
    items.push({ weight, item });
    let at = items.length - 1;
    while (at > 0) {
      const parent = (at - 1) >> 1;
      if (items[parent].weight >= weight) break;
      [items[at], items[parent]] = [items[parent], items[at]];
      at = parent;
    }
  }

  pop() {
    const items = this.#items;
    const top = items[0];
    const last = items.pop();
    if (items.length > 0) {
      items[0] = last;
      let at = 0;
      for (;;) {
        let child = 2 * at + 1;
        if (child + 1 < items.length && items[child + 1].weight > items[child].weight) child++;
        if (child >= items.length || items[child].weight <= last.weight) break;
        [items[at], items[child]] = [items[child], items[at]];
        at = child;
      }
    }
    return top.item;
  }
}
