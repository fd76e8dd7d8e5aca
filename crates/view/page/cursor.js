// What the cursor, or a finger, points at: told, measured, gone to.

import { add, distance, dot, scale } from "pm/math.js";

/** Milliseconds that the cursor rests before the point under it is looked up. */
const HOVER_MS = 120;

export class Cursor {
  constructor(app) {
    this.app = app;
  }

  /** What is drawn at a pixel: the cloud, its unit, the number of the point in it, and its depth. */
  pick(x, y) {
    const { clouds, renderer, camera } = this.app;
    const found = renderer.pick(clouds.filter((cloud) => cloud.isShown), camera, x, y);
    const at = found?.cloud?.unitOf(found.number, found.index);
    return at && { cloud: found.cloud, depth: found.depth, ...at };
  }

  /** The place at a pixel, from what is drawn there: as near as the picture, without asking for the point itself. */
  hit(x, y) {
    const found = this.pick(x, y);
    if (!found || !(found.depth > 0)) return null;
    const { camera } = this.app;
    const ray = camera.ray(x, y);
    return add(camera.eye, scale(ray, found.depth / -dot(ray, camera.back)));
  }

  /** Everything that is stored of the point at a pixel. */
  async pointAt(x, y, signal) {
    const found = this.pick(x, y);
    if (!found) return null;
    const point = await found.cloud.source.point(found.unit, found.index, signal);
    return { scene: found.cloud.scene, point };
  }

  hover(x, y) {
    clearTimeout(this.hovering);
    this.asking?.abort(); // the server decodes a whole unit for an answer
    this.hovering = setTimeout(() => this.tell(x, y), HOVER_MS);
  }

  /** The cursor is elsewhere, or the picture is another one: what was told is of something else. */
  leave() {
    clearTimeout(this.hovering);
    this.asking?.abort();
    this.app.pointBox.hide();
  }

  async tell(x, y) {
    const { messages, pointBox } = this.app;
    this.asking?.abort();
    const { signal } = (this.asking = new AbortController());
    try {
      const found = await this.pointAt(x, y, signal);
      if (signal.aborted) return;
      if (found) pointBox.show(found.scene, found.point);
      else pointBox.hide();
    } catch (error) {
      if (!signal.aborted) messages.fail(error.message);
    }
  }

  /** `isTold`: without a cursor that rests, a click asks for the point, too. */
  async click(x, y, isTold) {
    const { measure, messages, clouds } = this.app;
    if (isTold) this.tell(x, y);
    const found = measure.isOn && this.pick(x, y);
    if (!found) return;
    const key = `${clouds.indexOf(found.cloud)}/${found.unit}/${found.index}`;
    if (measure.entries.at(-1)?.key === key) return; // the second half of a double click
    const entry = measure.reserve(key);
    try {
      const { position } = await found.cloud.source.point(found.unit, found.index);
      measure.fill(entry, position);
    } catch (error) {
      measure.drop(entry);
      messages.fail(error.message);
    }
  }

  async goTo(x, y) {
    const { app } = this;
    const { camera } = app;
    if (app.measure.isOn) return; // two clicks of a measurement
    const { eye } = camera;
    const found = await this.pointAt(x, y).catch(() => null);
    if (!found || camera.eye !== eye) return; // who has moved on meanwhile stays there
    const reach = Math.max(distance(eye, camera.target) / 3, app.leastReach);
    camera.target = found.point.position;
    camera.eye = add(camera.target, scale(camera.back, reach));
    camera.update();
    app.changed();
  }
}
