// The view as the part of the address behind "#": a link that restores it.

import { GRADIENTS } from "pm/gl/palettes.js";
import { distance } from "pm/math.js";

/** Settings of one kind of dataset: the kind, what stands in no link, and what is possible. */
const OF_KINDS = { clod: ["batches", 1, [0, 10]], bits: ["batches", 0, [0, 30]], radius: ["bintree", 0, [0, 1]] };
const REST_MS = 300;
const SHAPES = ["square", "circle", "paraboloid"];

/** The address of the page, which follows the view. */
export class Address {
  constructor(app) {
    this.app = app;
  }

  /** After a change, once the view rests. */
  rest() {
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      try {
        history.replaceState(null, "", write(this.app));
      } catch {
        // browsers limit how often; the next change tries again
      }
    }, REST_MS);
  }

  async copy() {
    history.replaceState(null, "", write(this.app));
    await navigator.clipboard?.writeText(location.href).catch(() => undefined);
    this.app.messages.note(`Link: ${location.href}`, "link");
  }
}

export function write(app) {
  const { camera, renderer, budget, clouds, clipBox } = app;
  const { colour, range, size, edl, shape, boxes, isAdaptive, gradient, clip, hidden } = renderer.settings;
  const fields = { eye: list(camera.eye), target: list(camera.target), fov: camera.fov, colour, size, edl, shape, budget, gradient };
  if (app.isRangeChosen) fields.range = list(range);
  if (boxes) fields.boxes = 1;
  if (!isAdaptive) fields.adaptive = 0;
  if (clip) fields.clip = list([...clipBox.min, ...clipBox.max]);
  if (hidden.size > 0) fields.hide = list([...hidden].sort((a, b) => a - b));
  const off = clouds.flatMap((cloud, i) => (cloud.isShown ? [] : [i]));
  if (off.length > 0) fields.off = list(off);
  for (const [name, [kind, usual]] of Object.entries(OF_KINDS)) {
    const value = clouds.find((cloud) => cloud.scene.kind === kind)?.[name] ?? usual;
    if (value !== usual) fields[name] = value;
  }
  return `#${new URLSearchParams(fields).toString().replaceAll("%2C", ",")}`;
}

// a tenth of a millimetre at ten thousand kilometres
const list = (numbers) => numbers.map((x) => String(Number(x.toPrecision(12)))).join(",");

/**
 * What a link says, as far as it makes sense. What stands in no link because it is usual (no clip box, nothing hidden) is in
 * `settings` all the same: a link restores that, too.
 */
export function read(hash) {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  const numbers = (name, count) => {
    const found = (fields.get(name) || "x").split(",").map(Number);
    return found.every(Number.isFinite) && (!count || found.length === count) ? found : undefined;
  };
  const number = (name, low, high) => numbers(name, 1)?.find((value) => value >= low && value <= high);
  const oneOf = (name, known) => known.find((each) => each === fields.get(name));
  const settings = {
    colour: fields.get("colour") || undefined,
    size: number("size", 0.5, 10),
    edl: number("edl", 0, 2),
    shape: oneOf("shape", SHAPES),
    gradient: oneOf("gradient", GRADIENTS),
    boxes: fields.get("boxes") === "1",
    isAdaptive: fields.get("adaptive") !== "0",
    hidden: new Set(numbers("hide")),
  };
  const clip = numbers("clip", 6);
  return {
    settings: said(settings),
    eye: numbers("eye", 3),
    target: numbers("target", 3),
    fov: number("fov", 10, 120),
    budget: number("budget", 1e4, 2e7),
    range: numbers("range", 2),
    clip: clip && { min: clip.slice(0, 3), max: clip.slice(3) },
    off: numbers("off") ?? [],
    ofKinds: Object.entries(OF_KINDS).map(([name, [kind, usual, limits]]) => [kind, { [name]: number(name, ...limits) ?? usual }]),
  };
}

/** Only what was found. */
const said = (fields) => Object.fromEntries(Object.entries(fields).filter(([, value]) => value !== undefined));

/** Makes the app show what a link says, all but the range, which is returned: it belongs to a colouring that is chosen before. */
export function apply(app, hash) {
  const { settings, eye, target, fov, budget, range, clip, off, ofKinds } = read(hash);
  const { camera, renderer, clouds } = app;
  if (eye && target && distance(eye, target) > 0) Object.assign(camera, { eye, target });
  if (fov) camera.fov = fov;
  if (budget) app.budget = budget;
  Object.assign(renderer.settings, settings);
  app.setClipBox(clip);
  clouds.forEach((cloud, i) => (cloud.isShown = !off.includes(i)));
  for (const [kind, chosen] of ofKinds) app.each(kind, chosen);
  renderer.setTables();
  camera.update();
  return range;
}
