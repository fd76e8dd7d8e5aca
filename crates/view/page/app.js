// The page's state, and the loop that draws when something changed.

import { Camera, VIEWS } from "pm/camera.js";
import { Loader } from "pm/clouds/loader.js";
import { openCloud } from "pm/clouds/open.js";
import { Controls, onPlane } from "pm/controls.js";
import { open as openContext } from "pm/gl/context.js";
import { GRADIENTS } from "pm/gl/palettes.js";
import { ELSEWHERE, Renderer, isApart } from "pm/gl/renderer.js";
import { distance, dot, sub, union } from "pm/math.js";
import * as link from "pm/ui/link.js";
import { Measure } from "pm/ui/measure.js";
import { Panel } from "pm/ui/panel.js";
import { PointBox } from "pm/ui/point.js";

/** Milliseconds that the cursor rests before the point under it is looked up. */
const HOVER_MS = 120;
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
    this.canvas.addEventListener("webglcontextlost", () => messages.fail("The graphics card gave up the picture: load the page again, with fewer points."));
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
    this.#restore();
    this.panel = new Panel(document.getElementById("panel"), this);
    this.setColour(this.renderer.settings.colour);
    window.addEventListener("hashchange", () => {
      this.#restore();
      this.setColour(this.renderer.settings.colour);
    });
    requestAnimationFrame((time) => this.#loop(time));
  }

  #controls() {
    this.controls = new Controls(this.canvas, this.camera, {
      change: () => this.touch(),
      rest: () => this.#rest(),
      click: (x, y) => this.#click(x, y),
      hover: (x, y) => this.#hover(x, y),
      goTo: (x, y) => this.#goTo(x, y),
      under: (x, y, isFirst) => this.#under(x, y, isFirst),
      least: () => Math.max(distance(this.box.min, this.box.max) * 1e-9, 1e-6),
      most: () => Math.max(distance(this.box.min, this.box.max) * 1e3, 1),
      pace: () => Math.max(distance(this.box.min, this.box.max) / 10, 1e-3),
      key: (key) => this.#key(key),
    });
  }

  #restore() {
    const { eye, target, fov, budget, ...settings } = link.read(location.hash);
    if (eye && target && distance(eye, target) > 0) Object.assign(this.camera, { eye, target });
    if (fov) this.camera.fov = fov;
    if (budget) this.budget = budget;
    if (settings.gradient && !GRADIENTS.includes(settings.gradient)) delete settings.gradient;
    Object.assign(this.renderer.settings, settings);
    if (!settings.colour) this.renderer.settings.colour = this.#usualColour();
    this.renderer.setTables();
    this.camera.update();
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

  #loop(time) {
    if (this.controls.fly(Math.min((time - (this.time ?? time)) / 1000, 0.2))) this.touch();
    this.time = time;
    requestAnimationFrame((next) => this.#loop(next));
    if (!this.isDirty) return;
    this.isDirty = false;
    try {
      this.frame();
    } catch (error) {
      this.messages.fail(`The picture failed: ${error.message}`);
      throw error; // for the console
    }
  }

  /** One picture. */
  frame() {
    const shown = this.clouds.filter((cloud) => cloud.isShown);
    this.camera.setRange(shown.map((cloud) => cloud.box));
    const each = Math.floor(this.budget / Math.max(shown.length, 1));
    for (const cloud of shown) cloud.update(this.camera, each, this.loader);
    this.#newExtras(shown);
    this.#legend();
    this.renderer.draw(shown, this.camera);
    this.measure.draw();
    this.frames++;
    const points = shown.reduce((sum, cloud) => sum + cloud.shown, 0);
    if (points > 0) this.firstPicture ??= performance.now();
    const isLoading = shown.some((cloud) => cloud.isLoading);
    this.isIdle = !isLoading && this.loader.running === 0;
    this.status.textContent = `${points.toLocaleString("en")} points${isLoading ? " …" : ""}`;
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
    this.touch();
    this.#rest();
  }

  each(kind, fields) {
    for (const cloud of this.clouds) if (cloud.scene.kind === kind) Object.assign(cloud, fields);
    this.touch();
  }

  setBudget(points) {
    this.budget = points;
    this.touch();
    this.#rest();
  }

  setFov(degrees) {
    this.camera.fov = degrees;
    this.camera.update();
    this.touch();
    this.#rest();
  }

  setColour(wanted) {
    const names = new Set(this.clouds.flatMap((cloud) => cloud.scene.attributes.map((each) => each.name)));
    const needs = { class: "classification", intensity: "intensity" }[wanted];
    const isKnown = needs ? names.has(needs) : ELSEWHERE.includes(wanted) || names.has(wanted);
    const name = isKnown ? wanted : this.#usualColour();
    this.renderer.settings.colour = name;
    const chosen = ELSEWHERE.includes(name) ? name : "attribute";
    const found = this.clouds.flatMap((cloud) => {
      const mode = this.renderer.modeOf(cloud.scene);
      const shown = { attribute: name, class: "classification", intensity: "intensity" }[mode];
      const own = cloud.scene.attributes.find((each) => each.name === shown);
      cloud.extraBase = own?.min?.[0] ?? 0;
      cloud.setAttribute(own && isApart(cloud.scene, mode) ? own.name : undefined);
      return mode === chosen && own?.min && own?.max ? [[own.min[0], own.max[0]]] : [];
    });
    this.isRangeKnown = found.length > 0 || !["intensity", "attribute"].includes(chosen);
    if (name === "height") this.#setRange([this.box.min[2], this.box.max[2]]);
    else if (found.length > 0) this.#setRange([Math.min(...found.map((r) => r[0])), Math.max(...found.map((r) => r[1]))]);
    this.panel.colour.set(name);
    this.panel.ramp.hidden = ["rgb", "class", "level", "one"].includes(name);
    this.touch();
    this.#rest();
  }

  /** What a person says holds, whatever is loaded later. */
  typeRange(range) {
    this.isRangeKnown = true;
    this.change({ range });
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
    this.touch();
  }

  show(cloud, isShown) {
    cloud.isShown = isShown;
    this.touch();
  }

  look(name) {
    this.camera.fit(this.box, VIEWS[name]);
    this.touch();
    this.#rest();
  }

  fit(box) {
    this.camera.fit(box);
    this.touch();
    this.#rest();
  }

  setFlying(isFlying) {
    this.controls.isFlying = isFlying;
    this.panel.fly.setAttribute("aria-pressed", String(isFlying));
    this.canvas.focus();
  }

  setClipping(isOn) {
    this.clipBox ??= { min: [...this.box.min], max: [...this.box.max] };
    this.change({ clip: isOn ? this.clipBox : null });
  }

  setClip(end, axis, value) {
    this.clipBox ??= { min: [...this.box.min], max: [...this.box.max] };
    this.clipBox[end][axis] = value;
    this.panel.clip.set(true);
    this.change({ clip: this.clipBox });
  }

  #key(key) {
    const names = { t: "top", n: "north", s: "south", e: "east", w: "west", f: "fit" };
    if (names[key]) this.look(names[key]);
    else if (key === "m") this.measure.toggle();
    else if (key === "b") this.change({ boxes: !this.renderer.settings.boxes });
    else if (key === "escape") this.measure.clear();
  }

  /** What is drawn at a pixel: the cloud, its unit and the number of the point in it. */
  pick(x, y) {
    const shown = this.clouds.filter((cloud) => cloud.isShown);
    const found = this.renderer.pick(shown, this.camera, x, y);
    const at = found?.cloud?.unitOf(found.number, found.index);
    return at && { cloud: found.cloud, ...at };
  }

  /** Everything that is stored of the point at a pixel. */
  async pointAt(x, y) {
    const found = this.pick(x, y);
    if (!found) return null;
    const point = await found.cloud.source.point(found.unit, found.index);
    return { scene: found.cloud.scene, point };
  }

  #hover(x, y) {
    clearTimeout(this.hovering);
    this.hovering = setTimeout(async () => {
      const turn = (this.hoverTurn = (this.hoverTurn ?? 0) + 1);
      try {
        const found = await this.pointAt(x, y);
        if (turn !== this.hoverTurn) return;
        if (found) this.pointBox.show(found.scene, found.point);
        else this.pointBox.hide();
      } catch (error) {
        this.messages.fail(error.message);
      }
    }, HOVER_MS);
  }

  async #click(x, y) {
    if (!this.measure.isOn) return;
    const place = this.measure.begin();
    try {
      place((await this.pointAt(x, y))?.point.position);
    } catch (error) {
      place(undefined);
      this.messages.fail(error.message);
    }
  }

  async #goTo(x, y) {
    if (this.measure.isOn) return;
    const found = await this.pointAt(x, y).catch(() => null);
    if (!found) return;
    const { camera } = this;
    const reach = distance(camera.eye, camera.target) / 3;
    camera.target = found.point.position;
    camera.eye = camera.target.map((v, a) => v + camera.back[a] * reach);
    camera.update();
    this.touch();
    this.#rest();
  }

  /**
   * The place that the wheel comes nearer to: on the plane through the target, under the cursor. With a gesture that begins the
   * target comes to the depth of the point that is there, as soon as it is known.
   */
  #under(x, y, isFirst) {
    const turn = (this.wheelTurn = (this.wheelTurn ?? 0) + (isFirst ? 1 : 0));
    if (isFirst) {
      const looked = this.camera.back;
      const place = async () => {
        const found = await this.pointAt(x, y).catch(() => null);
        const { camera } = this;
        if (!found || turn !== this.wheelTurn || dot(camera.back, looked) < 1 - 1e-9) return;
        const depth = dot(sub(camera.eye, found.point.position), camera.back);
        if (depth > 0) camera.target = camera.eye.map((v, a) => v - camera.back[a] * depth);
      };
      place();
    }
    return onPlane(this.camera, this.camera.ray(x, y), this.camera.target);
  }

  /** After a change: the address gets the view, once it rests. */
  #rest() {
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      try {
        history.replaceState(null, "", link.write(this));
      } catch {
        // browsers limit how often; the next change tries again
      }
    }, 300);
  }

  async copyLink() {
    history.replaceState(null, "", link.write(this));
    await navigator.clipboard?.writeText(location.href).catch(() => undefined);
    this.messages.note(`Link: ${location.href}`);
  }

  savePicture() {
    this.frame(); // what is on the canvas is gone after the frame
    this.canvas.toBlob((blob) => {
      const a = document.createElement("a");
      a.href = URL.createObjectURL(blob);
      a.download = `${this.clouds[0]?.scene.name ?? "pointmill"}.png`;
      a.click();
      setTimeout(() => URL.revokeObjectURL(a.href), 1000);
    }, "image/png");
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
