// A frame: all clouds into a target with depth, eye-dome lighting into the canvas, boxes on top.

import { BATCH_ATTRIBUTES, POINT_ATTRIBUTES } from "pm/clouds/block.js";
import { Target, buffer, program, table } from "pm/gl/context.js";
import { classTable, gradient } from "pm/gl/palettes.js";
import * as shaders from "pm/gl/shaders.js";
import { clamp, sub } from "pm/math.js";

const MOST_INTEGER = 2 ** 31 - 1;
const FAR_AWAY = 1e30;
/** Pixels around the cursor in which a point is looked for. */
const PICK = 9;
const VALUES = { intensity: 0, height: 1, attribute: 2 };
/** Colourings that are no other attribute. */
export const ELSEWHERE = ["rgb", "class", "intensity", "height", "level", "one"];
const ATTRIBUTE = "attribute:";
/** The colouring by an attribute, whatever its name is: data may have a "level", too. */
export const colouringBy = (name) => ATTRIBUTE + name;
/** The attribute that a colouring names, or nothing. */
export const attributeOf = (colour) => (colour.startsWith(ATTRIBUTE) ? colour.slice(ATTRIBUTE.length) : undefined);
/** True if what a colouring shows comes as another attribute, beside the points' colours and intensities of 16 bits. */
export function isApart(scene, mode) {
  if (mode === "class") return scene.kind === "batches";
  if (mode !== "intensity") return mode === "attribute";
  const own = scene.attributes.find(({ name }) => name === "intensity");
  // without a range that is known, it grows with the values
  return scene.kind === "batches" || own?.type !== "uint16" || !own.max;
}
const MODES = { rgb: 0, class: 2, level: 3, one: 4 };

export class Renderer {
  constructor(gl) {
    this.gl = gl;
    const points = (fragment) => program(gl, shaders.POINTS, fragment, POINT_ATTRIBUTES);
    const batches = (fragment) => program(gl, shaders.BATCHES, fragment, BATCH_ATTRIBUTES);
    this.programs = {
      points: { draw: points(shaders.SHAPES) },
      batches: { draw: batches(shaders.SHAPES) },
    };
    // what the first picture does not need is compiled when it is needed
    this.makers = { points, batches };
    this.finish = program(gl, shaders.WHOLE, shaders.EYE_DOME, []);
    this.picture = new Target(gl, false);
    this.empty = gl.createVertexArray();
    this.tables = { gradient: table(gl, gradient("spectral")), classes: table(gl, classTable(new Set())) };
    this.settings = {
      colour: "rgb", range: [0, 1], size: 1, isAdaptive: true, least: 1, most: 40, shape: "square", edl: 0.4, boxes: false,
      background: [0.106, 0.114, 0.125], clip: null, one: [0.9, 0.9, 0.9], hidden: new Set(), gradient: "spectral",
    };
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }

  setTables() {
    const { gl } = this;
    gl.deleteTexture(this.tables.gradient);
    gl.deleteTexture(this.tables.classes);
    this.tables = { gradient: table(gl, gradient(this.settings.gradient)), classes: table(gl, classTable(this.settings.hidden)) };
  }

  #program(kind, purpose) {
    const fragments = { paraboloid: shaders.PARABOLOIDS, pick: shaders.NUMBERS };
    this.programs[kind][purpose] ??= this.makers[kind](fragments[purpose]);
    return this.programs[kind][purpose];
  }

  draw(clouds, camera) {
    const { gl, settings } = this;
    this.picture.resize(camera.width, camera.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.picture.frame);
    gl.viewport(0, 0, camera.width, camera.height);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.#points(clouds, camera, settings.shape === "paraboloid" ? "paraboloid" : "draw");
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, camera.width, camera.height);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.#lighting(camera);
    if (settings.boxes) this.#boxes(clouds, camera);
  }

  #points(clouds, camera, purpose) {
    clouds.forEach((cloud, index) => {
      const kind = cloud.scene.kind === "batches" ? "batches" : "points";
      const used = this.#program(kind, purpose);
      this.gl.useProgram(used.program);
      this.#common(used.at, cloud, camera);
      const base = index << 24; // number of the dataset in what is picked
      if (kind === "batches") this.#batches(used.at, cloud, camera, base);
      else this.#nodes(used.at, cloud, camera, base);
    });
    this.gl.bindVertexArray(null);
  }

  #common(at, cloud, camera) {
    const { gl, settings } = this;
    const { scene } = cloud;
    gl.uniformMatrix4fv(at.uMatrix, false, camera.matrix);
    gl.uniform3fv(at.uBack, camera.back);
    gl.uniform1f(at.uFocal, camera.focal);
    gl.uniform2f(at.uSizes, settings.least, settings.most);
    gl.uniform1f(at.uSize, settings.size);
    gl.uniform1i(at.uIsWorld, 0);
    const clip = settings.clip;
    gl.uniform3fv(at.uClipMin, clip ? sub(clip.min, camera.eye) : [-FAR_AWAY, -FAR_AWAY, -FAR_AWAY]);
    gl.uniform3fv(at.uClipMax, clip ? sub(clip.max, camera.eye) : [FAR_AWAY, FAR_AWAY, FAR_AWAY]);
    const mode = this.modeOf(scene);
    gl.uniform1i(at.uColour, MODES[mode] ?? 1);
    if (mode in VALUES) {
      gl.uniform1i(at.uValue, isApart(scene, mode) ? VALUES.attribute : VALUES[mode]);
      const [low, high] = this.#range(mode, cloud);
      gl.uniform2f(at.uRange, low, 1 / Math.max(high - low, 1e-30));
    }
    gl.uniform1f(at.uEyeHeight, camera.eye[2] - this.heightBase);
    gl.uniform3fv(at.uOne, settings.one);
    gl.uniform1i(at.uFilter, settings.hidden.size > 0 && this.knowsClasses(cloud) ? 1 : 0);
    gl.uniform1i(at.uShape, settings.shape === "circle" ? 1 : 0);
    gl.uniform2f(at.uDepth, -camera.projection[10], camera.projection[14]);
    [[at.uGradient, this.tables.gradient], [at.uClasses, this.tables.classes]].forEach(([place, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(place, unit);
    });
    gl.uniform1i(at.uNodes, 2);
  }

  /** Heights are singles relative to this, world units. */
  heightBase = 0;

  /** Whether points come with their classes: batches have them as the attribute that is shown. */
  knowsClasses(cloud) {
    return cloud.hasClasses && (cloud.scene.kind !== "batches" || this.modeOf(cloud.scene) === "class");
  }

  /** The colouring of a dataset: one that it can show. */
  modeOf(scene) {
    const { colour } = this.settings;
    const has = (name) => scene.attributes.some((attribute) => attribute.name === name);
    if (colour === "rgb" && !scene.colour) return has("intensity") ? "intensity" : "height";
    if (colour === "class" && !has("classification")) return "height";
    if (colour === "intensity" && !has(colour)) return "height";
    if (ELSEWHERE.includes(colour)) return colour;
    return has(attributeOf(colour)) ? "attribute" : "height";
  }

  /** The range that was chosen, or, of a dataset that shows something else, its own. */
  #range(mode, cloud) {
    const { colour } = this.settings;
    let [low, high] = this.settings.range;
    if (mode !== (ELSEWHERE.includes(colour) ? colour : "attribute")) {
      const own = cloud.scene.attributes.find(({ name }) => name === "intensity");
      const { min, max } = cloud.box;
      [low, high] = mode === "height" ? [min[2], max[2]] : [own?.min?.[0] ?? 0, own?.max?.[0] ?? 65535];
    }
    if (mode === "height") return [low - this.heightBase, high - this.heightBase];
    if (!isApart(cloud.scene, mode)) return [low, high];
    return [low - cloud.extraBase, high - cloud.extraBase];
  }

  #nodes(at, cloud, camera, base) {
    const { gl, settings } = this;
    const isAdaptive = settings.isAdaptive && cloud.scene.kind === "octree";
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, isAdaptive ? cloud.nodeTable() : null);
    if (isAdaptive) {
      gl.uniform1i(at.uIsWorld, 1);
      gl.uniform1f(at.uSpacing, cloud.scene.spacing);
      gl.uniform1f(at.uSize, settings.size);
    }
    gl.uniform1i(at.uFirst, -1);
    gl.uniform1i(at.uMaterial, 0);
    for (const draw of cloud.draws(camera)) {
      const { block } = draw;
      // the eye in whole steps of this unit, and what is left of it
      const whole = [0, 1, 2].map((a) => {
        const steps = (camera.eye[a] - block.origin[a]) / block.step[a];
        return Number.isFinite(steps) ? Math.round(clamp(steps, 0, MOST_INTEGER)) : 0;
      });
      gl.uniform3iv(at.uEye, whole);
      gl.uniform3fv(at.uRest, [0, 1, 2].map((a) => camera.eye[a] - block.origin[a] - whole[a] * block.step[a]));
      gl.uniform3fv(at.uStep, block.step);
      gl.uniform1f(at.uLevel, draw.level);
      gl.uniform1ui(at.uUnit, base + draw.unit);
      if (isAdaptive) {
        gl.uniform1i(at.uFirst, draw.row);
        gl.uniform3fv(at.uCubeMin, draw.cubeMin);
        gl.uniform1f(at.uSide, draw.side);
      }
      if (draw.material !== undefined) this.#material(at, draw, cloud);
      gl.bindVertexArray(block.vao);
      if (!block.extraRange) gl.vertexAttrib1f(2, 0);
      gl.drawArrays(gl.POINTS, 0, block.count);
    }
  }

  /** Far: a pixel. Near: discs of a radius in the world. */
  #material(at, draw, cloud) {
    const { gl, settings } = this;
    const isNear = draw.material === 2;
    gl.uniform1i(at.uMaterial, draw.material);
    gl.uniform1f(at.uSwitch, draw.limit);
    gl.uniform1i(at.uIsWorld, isNear ? 1 : 0);
    gl.uniform1f(at.uSize, isNear ? 2 * cloud.radius : draw.material === 1 ? 1 : settings.size);
    gl.uniform1i(at.uShape, isNear ? 1 : 0);
  }

  #batches(at, cloud, camera, base) {
    const { gl } = this;
    gl.uniform1f(at.uExtraBase, cloud.extraBase);
    for (const draw of cloud.draws(camera)) {
      gl.uniform1i(at.uBits, draw.bits);
      gl.uniform1i(at.uIsWorld, this.settings.isAdaptive ? 1 : 0);
      gl.uniform1f(at.uSize, this.settings.size * (this.settings.isAdaptive ? draw.spacing : 1));
      gl.uniform3fv(at.uBoxMin, draw.boxMin);
      gl.uniform3fv(at.uBoxSides, draw.sides);
      gl.uniform1ui(at.uStart, draw.start);
      gl.uniform1f(at.uClod, draw.clod);
      gl.uniform1f(at.uCell, draw.cell);
      gl.uniform1f(at.uLevel, -1);
      gl.uniform1ui(at.uUnit, base + draw.unit);
      gl.bindVertexArray(draw.block.vao);
      for (let plane = draw.block.planes; plane < 3; plane++) gl.vertexAttribI4ui(plane, 0, 0, 0, 0);
      if (!draw.block.extraRange) gl.vertexAttrib1f(5, 0);
      gl.drawArrays(gl.POINTS, 0, draw.block.count);
    }
  }

  #lighting(camera) {
    const { gl, settings, finish } = this;
    gl.useProgram(finish.program);
    [this.picture.colour, this.picture.depth].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.uniform1i(finish.at.uPicture, 0);
    gl.uniform1i(finish.at.uDepths, 1);
    gl.uniform2f(finish.at.uDepth, -camera.projection[10], camera.projection[14]);
    gl.uniform1f(finish.at.uStrength, settings.edl);
    gl.uniform1i(finish.at.uAway, Math.max(1, Math.floor(camera.height / 1080)));
    gl.uniform3fv(finish.at.uBackground, settings.background);
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
  }

  #boxes(clouds, camera) {
    const { gl } = this;
    this.lines ??= this.#lineProgram();
    const { at, vao, used } = this.lines;
    gl.useProgram(used);
    gl.uniformMatrix4fv(at.uMatrix, false, camera.matrix);
    gl.bindVertexArray(vao);
    for (const { box, level } of clouds.flatMap((cloud) => cloud.boxes())) {
      const hue = (level * 0.381966) % 1;
      gl.uniform3fv(at.uOne, [0, 2, 4].map((k) => clamp(Math.abs(((hue * 6 + 6 - k) % 6) - 3) - 1, 0.2, 1)));
      gl.uniform3fv(at.uBoxMin, sub(box.min, camera.eye));
      gl.uniform3fv(at.uBoxSides, sub(box.max, box.min));
      gl.drawArrays(gl.LINES, 0, 24);
    }
    gl.bindVertexArray(null);
  }

  #lineProgram() {
    const { gl } = this;
    const { program: used, at } = program(gl, shaders.LINES, shaders.LINE_COLOUR, ["aCorner"]);
    const corner = (bits) => [bits & 1, (bits >> 1) & 1, bits >> 2];
    const ends = [];
    for (let from = 0; from < 8; from++) {
      for (const bit of [1, 2, 4]) if (!(from & bit)) ends.push(...corner(from), ...corner(from | bit));
    }
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    buffer(gl, new Float32Array(ends));
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    return { used, at, vao };
  }

  /** The drawn point nearest to a pixel: { cloud, number, index, depth }, or nothing. Row 0 is at the top. */
  pick(clouds, camera, x, y) {
    const { gl } = this;
    this.numbers ??= new Target(gl, true);
    this.numbers.resize(camera.width, camera.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.numbers.frame);
    gl.viewport(0, 0, camera.width, camera.height);
    const half = (PICK - 1) / 2;
    const [left, bottom] = [Math.round(x) - half, camera.height - 1 - Math.round(y) - half];
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(left, bottom, PICK, PICK);
    gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.#points(clouds, camera, "pick");
    gl.disable(gl.SCISSOR_TEST);
    const found = new Uint32Array(PICK * PICK * 4);
    gl.readPixels(left, bottom, PICK, PICK, gl.RGBA_INTEGER, gl.UNSIGNED_INT, found);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    let best = null;
    for (let i = 0; i < PICK * PICK; i++) {
      const unit = found[4 * i];
      const away = Math.hypot((i % PICK) - half, Math.floor(i / PICK) - half);
      if (unit > 0 && (!best || away < best.away)) best = { away, unit: unit - 1, index: found[4 * i + 1], at: 4 * i + 2 };
    }
    const depth = best && new Float32Array(found.buffer)[best.at];
    return best && { cloud: clouds[best.unit >>> 24], number: best.unit & 0xffffff, index: best.index, depth };
  }
}
