// Distances between points that are clicked, drawn over the picture.

import { distance } from "pm/math.js";

const SVG = "http://www.w3.org/2000/svg";

export const metres = (x) => (x === 0 ? "0" : Math.abs(x) >= 1e7 || Math.abs(x) < 1e-4 ? x.toExponential(4) : String(Number(x.toFixed(4))));

export class Measure {
  constructor(app, overlay) {
    Object.assign(this, { app, overlay, clicks: [], isOn: false });
  }

  toggle() {
    this.isOn = !this.isOn;
    this.app.panel.measuring.setAttribute("aria-pressed", String(this.isOn));
  }

  clear() {
    this.clicks = [];
    this.draw();
  }

  /** A click; the function takes the place once it is known, or nothing. Points keep the order of the clicks. */
  begin() {
    const click = {};
    this.clicks.push(click);
    return (place) => {
      if (place) click.place = place;
      else this.clicks = this.clicks.filter((each) => each !== click);
      this.draw();
    };
  }

  get points() {
    return this.clicks.map(({ place }) => place).filter(Boolean);
  }

  /** Lengths of the parts and of all together, world units. */
  get lengths() {
    const { points } = this;
    return points.slice(1).map((place, i) => distance(place, points[i]));
  }

  draw() {
    const { camera } = this.app;
    const { points, lengths } = this;
    const ratio = this.app.ratio;
    const at = points.map((place) => camera.project(place)?.map((v) => v / ratio));
    const nodes = [];
    const add = (name, fields, text) => {
      const made = document.createElementNS(SVG, name);
      for (const [key, value] of Object.entries(fields)) made.setAttribute(key, value);
      if (text) made.textContent = text;
      nodes.push(made);
    };
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
