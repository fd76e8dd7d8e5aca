// Distances between points that are clicked, drawn over the picture.

import { distance } from "pm/math.js";

const SVG = "http://www.w3.org/2000/svg";

export const metres = (x) => (x === 0 ? "0" : Math.abs(x) >= 1e7 || Math.abs(x) < 1e-4 ? x.toExponential(4) : String(Number(x.toFixed(4))));

export class Measure {
  constructor(app, overlay) {
    Object.assign(this, { app, overlay, entries: [], isOn: false });
  }

  toggle() {
    this.isOn = !this.isOn;
    this.app.panel.measuring.setAttribute("aria-pressed", String(this.isOn));
  }

  clear() {
    this.entries = [];
    this.draw();
  }

  /** A place in the order of clicks: answers may come in another one. `key` tells points apart. */
  reserve(key) {
    const entry = { key };
    this.entries.push(entry);
    return entry;
  }

  fill(entry, place) {
    entry.place = place;
    this.draw();
  }

  drop(entry) {
    this.entries = this.entries.filter((each) => each !== entry);
    this.draw();
  }

  get points() {
    return this.entries.flatMap(({ place }) => (place ? [place] : []));
  }

  /** Lengths of the parts and of all together, world units. */
  get lengths() {
    const points = this.points;
    return points.slice(1).map((place, i) => distance(place, points[i]));
  }

  draw() {
    const { camera } = this.app;
    const ratio = this.app.ratio;
    const points = this.points;
    const at = points.map((place) => camera.project(place)?.map((v) => v / ratio));
    const nodes = [];
    const add = (name, fields, text) => {
      const made = document.createElementNS(SVG, name);
      for (const [key, value] of Object.entries(fields)) made.setAttribute(key, value);
      if (text) made.textContent = text;
      nodes.push(made);
    };
    const lengths = this.lengths;
    lengths.forEach((length, i) => {
      const [a, b] = [at[i], at[i + 1]];
      if (!a || !b) return;
      add("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1] });
      const rise = points[i + 1][2] - points[i][2];
      add("text", { x: (a[0] + b[0]) / 2 + 6, y: (a[1] + b[1]) / 2 }, `${metres(length)} (Δz ${metres(rise)})`);
    });
    for (const place of at) if (place) add("circle", { cx: place[0], cy: place[1], r: 4 });
    const last = at.at(-1);
    if (last && lengths.length > 1) add("text", { x: last[0] + 8, y: last[1] + 16 }, `Σ ${metres(lengths.reduce((a, b) => a + b, 0))}`);
    this.overlay.replaceChildren(...nodes);
  }
}
