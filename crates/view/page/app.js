// The page's state, and the loop that draws when something changed.

import { Camera, VIEWS } from "pm/camera.js";
import { Loader } from "pm/clouds/loader.js";
import { openCloud } from "pm/clouds/open.js";
import { shares } from "pm/clouds/units.js";
import * as clipping from "pm/clip.js";
import { Controls } from "pm/controls.js";
import { Cursor } from "pm/cursor.js";
import { open as openContext } from "pm/gl/context.js";
import { ELSEWHERE, Renderer, attributeOf, colouringBy, isApart } from "pm/gl/renderer.js";
import { distance, union } from "pm/math.js";
import { recoverWhenLost } from "pm/recover.js";
import * as link from "pm/ui/link.js";
import { Measure } from "pm/ui/measure.js";
import { Panel } from "pm/ui/panel.js";
import { PointBox } from "pm/ui/point.js";

const FEW_POINTS = 10_000;

export class App {
  constructor(messages, config) {
    Object.assign(this, { messages, config, clouds: [], budget: 1_000_000, isDirty: true, frames: 0 });
    this.canvas = document.getElementById("picture");
    this.status = document.getElementById("status");
    this.gl = openContext(this.canvas);
    this.renderer = new Renderer(this.gl);
    this.camera = new Camera();
    this.loader = new Loader(
      () => this.touch(),
      (error) => messages.fail(error.message),
      (error) => messages.remove(error.message),
    );
    this.pointBox = new PointBox(document.getElementById("point"));
    this.measure = new Measure(this, document.getElementById("overlay"));
    this.cursor = new Cursor(this);
    this.address = new link.Address(this);
    recoverWhenLost(this);
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    this.resize();
  }

  /** Opens datasets; one that cannot be opened is told, the others are shown. */
  async open(sources) {
    const opened = await Promise.allSettled(sources.map((source) => openCloud(this.gl, source)));
    for (const result of opened) {
      if (result.status === "fulfilled") this.clouds.push(result.value);
      else this.messages.fail(result.reason.message);
    }
    const clouds = this.clouds;
    clouds.forEach((cloud) => (cloud.isShown = true));
    if (clouds.length === 0) throw new Error("There is nothing to show.");
    document.title = `${clouds.map((cloud) => cloud.scene.name).join(", ")} – pointmill`;
    this.box = union(clouds.filter((cloud) => cloud.scene.points !== 0).map((cloud) => cloud.box));
    if (!(this.box.min[0] <= this.box.max[0])) this.box = { min: [0, 0, 0], max: [0, 0, 0] };
    if (clouds.every((cloud) => cloud.scene.points === 0)) this.messages.note("The dataset has no points.");
    this.renderer.heightBase = this.box.min[2];
    // a few points have to be found first
    if (clouds.reduce((sum, cloud) => sum + (cloud.scene.points ?? FEW_POINTS), 0) < FEW_POINTS) this.renderer.settings.least = 4;
    for (const cloud of clouds) cloud.hasClasses = cloud.scene.attributes.some(({ name }) => name === "classification");
    this.#controls();
    this.camera.fit(this.box, VIEWS.fit);
    this.#restore(this.#usualColour());
    // a link that is pasted into the same tab
    addEventListener("hashchange", () => this.#restore(this.renderer.settings.colour));
    requestAnimationFrame((time) => this.#loop(time));
  }

  #controls() {
    const { cursor } = this;
    this.controls = new Controls(this.canvas, this.camera, {
      change: () => {
        cursor.leave();
        this.touch();
      },
      rest: () => this.address.rest(),
      click: (x, y, isTold) => cursor.click(x, y, isTold),
      hover: (x, y) => cursor.hover(x, y),
      leave: () => cursor.leave(),
      goTo: (x, y) => cursor.goTo(x, y),
      hit: (x, y) => cursor.hit(x, y),
      least: () => this.leastReach,
      most: () => Math.max(distance(this.box.min, this.box.max) * 1e3, 1),
      pace: () => Math.max(distance(this.box.min, this.box.max) / 10, 1e-3),
      key: (key) => this.#key(key),
    });
  }

  /** World units between eye and target, at least: what doubles tell apart. */
  get leastReach() {
    return Math.max(distance(this.box.min, this.box.max) * 1e-9, 1e-6);
  }

  /** What the address says; `colour` where it says none. */
  #restore(colour) {
    this.renderer.settings.colour = colour;
    this.showPanel(link.apply(this, location.hash));
  }

  /** The settings as they are, after more than one of them has changed. */
  showPanel(range) {
    this.panel = new Panel(document.getElementById("panel"), this);
    this.classCount = undefined;
    this.setColour(this.renderer.settings.colour);
    if (range) this.chooseRange(range);
  }

  /** Coloured by what there is. */
  #usualColour() {
    const has = (name) => this.clouds.some((cloud) => cloud.scene.attributes.some((attribute) => attribute.name === name));
    if (this.clouds.some((cloud) => cloud.scene.colour)) return "rgb";
    if (has("intensity")) return "intensity";
    return "height";
  }

  get ratio() {
    return this.camera.height / Math.max(this.canvas.clientHeight, 1);
  }

  resize() {
    const density = Math.min(window.devicePixelRatio || 1, 2);
    const size = [this.canvas.clientWidth, this.canvas.clientHeight].map((pixels) => Math.max(1, Math.round(pixels * density)));
    [this.canvas.width, this.canvas.height] = size;
    [this.camera.width, this.camera.height] = size;
    this.camera.update();
    this.touch();
  }

  touch() {
    this.isDirty = true;
  }

  /** A view was chosen: draws it, and the address gets it. */
  changed() {
    this.touch();
    this.address.rest();
  }

  #loop(time) {
    try {
      if (this.controls.fly(Math.min((time - (this.time ?? time)) / 1000, 0.2))) this.touch();
      this.time = time;
      if (this.isDirty && !this.isLost) {
        this.isDirty = false;
        this.frame();
      }
    } catch (error) {
      this.messages.fail(`The picture cannot be drawn: ${error.message}`);
      console.error(error); // where it was
    } finally {
      requestAnimationFrame((next) => this.#loop(next)); // one picture that fails is not the last
    }
  }

  /** One picture. */
  frame() {
    const shown = this.clouds.filter((cloud) => cloud.isShown);
    this.camera.setRange(shown.map((cloud) => cloud.box));
    const points = shares(shown, this.budget);
    for (const cloud of shown) cloud.update(this.camera, points.get(cloud), this.loader);
    this.#newExtras(shown);
    this.#legend();
    this.renderer.draw(shown, this.camera);
    this.measure.draw();
    this.frames++;
    const drawn = shown.reduce((sum, cloud) => sum + cloud.shown, 0);
    if (drawn > 0) this.firstPicture ??= performance.now();
    const isLoading = shown.some((cloud) => cloud.isLoading);
    this.isIdle = !isLoading && this.loader.running === 0;
    this.status.textContent = `${drawn.toLocaleString("en")} points${isLoading ? " …" : ""}`;
  }

  /** The range of another attribute grows with what is loaded, unless the dataset says it. */
  #newExtras(shown) {
    if (this.isRangeKnown) return;
    let [low, high] = [Infinity, -Infinity];
    for (const cloud of shown) {
      for (const { block } of cloud.draws(this.camera)) {
        if (!block.extraRange) continue;
        low = Math.min(low, block.extraRange[0] + cloud.extraBase);
        high = Math.max(high, block.extraRange[1] + cloud.extraBase);
      }
    }
    if (low <= high) this.#setRange([low, high]);
  }

  /** Settles when everything is loaded that this view wants. */
  async idle() {
    const next = () => new Promise((done) => setTimeout(done, 20));
    do {
      this.touch();
      await next();
      await new Promise((done) => requestAnimationFrame(done));
    } while (!this.isIdle);
  }

  change(settings) {
    Object.assign(this.renderer.settings, settings);
    if (settings.gradient) this.renderer.setTables();
    this.changed();
  }

  each(kind, fields) {
    for (const cloud of this.clouds) if (cloud.scene.kind === kind) Object.assign(cloud, fields);
    this.changed();
  }

  setBudget(points) {
    this.budget = points;
    this.changed();
  }

  setFov(degrees) {
    this.camera.fov = degrees;
    this.camera.update();
    this.changed();
  }

  setColour(wanted) {
    const names = new Set(this.clouds.flatMap((cloud) => cloud.scene.attributes.map((each) => each.name)));
    const needs = { class: "classification", intensity: "intensity" };
    const other = attributeOf(wanted) ?? wanted;
    let name = this.#usualColour();
    if (wanted in needs ? names.has(needs[wanted]) : ELSEWHERE.includes(wanted)) name = wanted;
    else if (names.has(other)) name = colouringBy(other);
    this.renderer.settings.colour = name;
    const chosen = ELSEWHERE.includes(name) ? name : "attribute";
    const found = this.clouds.flatMap((cloud) => {
      const mode = this.renderer.modeOf(cloud.scene);
      const shown = { attribute: attributeOf(name), class: "classification", intensity: "intensity" }[mode];
      const own = cloud.scene.attributes.find((each) => each.name === shown);
      cloud.extraBase = own?.min?.[0] ?? 0;
      cloud.setAttribute(own && isApart(cloud.scene, mode) ? own.name : undefined);
      return mode === chosen && own?.min && own?.max ? [[own.min[0], own.max[0]]] : [];
    });
    this.isRangeKnown = found.length > 0 || !["intensity", "attribute"].includes(chosen);
    this.isRangeChosen = false;
    if (name === "height") this.#setRange([this.box.min[2], this.box.max[2]]);
    else if (found.length > 0) this.#setRange([Math.min(...found.map((r) => r[0])), Math.max(...found.map((r) => r[1]))]);
    this.panel.colour.set(name);
    this.panel.ramp.hidden = ["rgb", "class", "level", "one"].includes(name);
    this.panel.setFilter(this.clouds.some((cloud) => this.renderer.knowsClasses(cloud)));
    this.changed();
  }

  /** A range that was typed: it stays, whatever is loaded. */
  chooseRange(range) {
    this.isRangeKnown = true;
    this.isRangeChosen = true;
    this.#setRange(range);
    this.changed();
  }

  #setRange(range) {
    this.renderer.settings.range = range;
    this.panel.range.set(range);
  }

  #legend() {
    const numbers = new Set(this.clouds.flatMap((cloud) => [...cloud.classes]));
    if (numbers.size === this.classCount) return;
    this.classCount = numbers.size;
    this.panel.setClasses(numbers);
  }

  showClass(number, isShown) {
    const { hidden } = this.renderer.settings;
    if (isShown) hidden.delete(number);
    else hidden.add(number);
    this.renderer.setTables();
    this.changed();
  }

  show(cloud, isShown) {
    cloud.isShown = isShown;
    if (!isShown) cloud.forget(0); // but for what was drawn last
    this.changed();
  }

  look(name) {
    this.camera.fit(this.box, VIEWS[name]);
    this.cursor.leave();
    this.changed();
  }

  fit(box) {
    this.camera.fit(box);
    this.changed();
  }

  setFlying(isFlying) {
    this.controls.setFlying(isFlying);
    this.panel.fly.setAttribute("aria-pressed", String(isFlying));
    this.canvas.focus();
  }

  /** The box outside of which nothing is drawn; without one, everything is. */
  setClipBox(box) {
    if (box) this.clipBox = box;
    this.change({ clip: box ? clipping.drawn(box, this.box) : null });
  }

  setClipping(isOn) {
    this.setClipBox(isOn ? (this.clipBox ?? clipping.copy(this.box)) : null);
  }

  setClip(end, axis, value) {
    const box = clipping.copy(this.clipBox ?? this.box);
    box[end][axis] = value;
    this.panel.clip.set(true);
    this.setClipBox(box);
  }

  #key(key) {
    const names = { t: "top", n: "north", s: "south", e: "east", w: "west", f: "fit" };
    if (names[key]) this.look(names[key]);
    else if (key === "enter") this.cursor.click(this.camera.width / 2, this.camera.height / 2, true);
    else if (key === "m") this.measure.toggle();
    else if (key === "b") this.change({ boxes: !this.renderer.settings.boxes });
    else if (key === "escape") this.measure.clear();
  }

  pick(x, y) {
    return this.cursor.pick(x, y);
  }

  pointAt(x, y) {
    return this.cursor.pointAt(x, y);
  }

  systems() {
    return [...new Set(this.clouds.map((cloud) => cloud.scene.projection).filter(Boolean))].join("; ");
  }

  /** For tests: what is on the screen, and what it took. */
  stats() {
    // until there was a picture
    const entries = performance.getEntriesByType("resource").filter((entry) => entry.responseEnd <= (this.firstPicture ?? Infinity));
    return {
      points: this.clouds.reduce((sum, cloud) => sum + cloud.shown, 0),
      firstPicture: this.firstPicture,
      requests: entries.length + 1,
      bytes: entries.reduce((sum, entry) => sum + entry.encodedBodySize, 0),
      frames: this.frames,
      isIdle: this.isIdle,
      gpuBytes: this.clouds.reduce((sum, cloud) => sum + cloud.bytes, 0),
    };
  }
}
