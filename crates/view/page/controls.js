// Orbit, pan and zoom as in Potree: left button turns, right button (or with Shift) moves, the wheel comes nearer to what is under the
// cursor, a double click goes there. Fly: W A S D, Q and E, the mouse looks. One finger turns, two move and zoom. By keys: arrows turn,
// with Shift they move, + and - zoom.

import { add, clamp, distance, dot, scale, sub, unit } from "pm/math.js";

/** Angle, radians, below which the eye does not come to the vertical. */
const UPRIGHT = 0.01;
/** Pixels of the style sheet that a click may move; a finger rolls. */
const CLICK_MOVES = { mouse: 5, other: 10 };
/** Milliseconds and pixels of the style sheet: a wheel that rests, or a cursor that moves as far, begins a new gesture. */
const GESTURE_MS = 300;
const GESTURE_PIXELS = 5;
/** Within a gesture the place is looked for again when it is this much nearer: what is there is seen better then. */
const GESTURE_NEARER = 4;
/** Times as far as that place: behind it. */
const BEHIND = 1.5;
/** Pixels of the style sheet that an arrow key turns or moves by, and the notches of the keys + and -. */
const KEY_PIXELS = 40;
const KEY_NOTCHES = 1;
const ARROWS = { arrowleft: [-1, 0], arrowright: [1, 0], arrowup: [0, -1], arrowdown: [0, 1] };

export class Controls {
  constructor(canvas, camera, actions) {
    Object.assign(this, { canvas, camera, actions, isFlying: false, speed: 1, pointers: new Map(), keys: new Set() });
    const on = (name, act) => canvas.addEventListener(name, act, { passive: false });
    on("pointerdown", (event) => this.#down(event));
    on("pointermove", (event) => this.#move(event));
    on("pointerup", (event) => this.#up(event));
    on("pointercancel", (event) => this.#up(event));
    on("wheel", (event) => this.#wheel(event));
    on("contextmenu", (event) => event.preventDefault());
    on("dblclick", (event) => actions.goTo(...this.#pixel(event)));
    on("keydown", (event) => this.#key(event, true));
    on("keyup", (event) => this.#key(event, false));
    on("pointerleave", (event) => event.pointerType === "mouse" && actions.leave());
    on("blur", () => {
      this.keys.clear();
      this.#isPointed(false);
    });
  }

  /** Pixels of the picture per pixel of the style sheet. */
  get #density() {
    return this.camera.height / Math.max(this.canvas.clientHeight, 1);
  }

  setFlying(isFlying) {
    this.isFlying = isFlying;
    this.keys.clear();
  }

  #pixel(event) {
    const rect = this.canvas.getBoundingClientRect();
    const ratio = this.camera.width / rect.width;
    return [(event.clientX - rect.left) * ratio, (event.clientY - rect.top) * ratio];
  }

  /** For the style: frame and cross are for those who use keys, and browsers show the frame after `focus()`, too. */
  #isPointed(isPointed) {
    this.canvas.classList.toggle("pointed", isPointed);
  }

  #down(event) {
    this.#isPointed(true);
    this.canvas.focus();
    try {
      this.canvas.setPointerCapture(event.pointerId);
    } catch {
      // a pointer that is gone already
    }
    this.pointers.set(event.pointerId, this.#pixel(event));
    this.travelled = 0;
  }

  #up(event) {
    const isMouse = event.pointerType === "mouse";
    const isStill = this.travelled / this.#density < (isMouse ? CLICK_MOVES.mouse : CLICK_MOVES.other);
    const wasClick = this.pointers.size === 1 && isStill && event.type === "pointerup" && event.button === 0;
    this.pointers.delete(event.pointerId);
    // a finger has no way to rest above a point: a tap asks for it
    if (wasClick) this.actions.click(...this.#pixel(event), !isMouse);
    this.actions.rest();
  }

  #move(event) {
    const now = this.#pixel(event);
    const before = this.pointers.get(event.pointerId);
    if (!before) return this.actions.hover(...now);
    const moved = [now[0] - before[0], now[1] - before[1]];
    this.travelled += Math.hypot(...moved);
    if (this.pointers.size === 2) this.#pinch(event.pointerId, before, now);
    else if (event.buttons & 2 || event.buttons & 4 || event.shiftKey) this.pan(...moved);
    else this.turn(...moved);
    this.pointers.set(event.pointerId, now);
    this.actions.change();
  }

  #pinch(id, before, now) {
    const other = [...this.pointers].find(([key]) => key !== id)[1];
    const span = (a) => Math.max(Math.hypot(a[0] - other[0], a[1] - other[1]), 1);
    this.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    this.zoom(span(before) / span(now));
  }

  /** Around the target, or of the view when flying; pixels. */
  turn(dx, dy) {
    const { camera } = this;
    const k = this.isFlying ? -1 : 1;
    const angle = (Math.PI / camera.height) * k;
    const away = sub(camera.eye, camera.target);
    const reach = distance(camera.eye, camera.target);
    const flat = Math.atan2(away[1], away[0]);
    const tilt = Math.asin(clamp(away[2] / reach, -1, 1));
    // straight down there is no direction: it is that of the picture's lower edge
    const around = Math.hypot(away[0], away[1]) < 1e-9 * reach ? Math.atan2(-camera.up[1], -camera.up[0]) : flat;
    const [yaw, pitch] = [around - dx * angle, clamp(tilt + dy * angle, UPRIGHT - Math.PI / 2, Math.PI / 2 - UPRIGHT)];
    const arm = scale([Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch)], reach);
    if (this.isFlying) camera.target = sub(camera.eye, arm);
    else camera.eye = add(camera.target, arm);
    camera.update();
  }

  pan(dx, dy) {
    const { camera } = this;
    const perPixel = distance(camera.eye, camera.target) / camera.focal;
    const by = add(scale(camera.right, -dx * perPixel), scale(camera.up, dy * perPixel));
    camera.eye = add(camera.eye, by);
    camera.target = add(camera.target, by);
    camera.update();
  }

  /**
   * Towards a place, which keeps its pixel; a factor below 1 comes nearer. The target comes to the depth of the place, so that
   * nearness is never used up while the place is still far.
   */
  zoom(factor, place = this.camera.target) {
    const { camera } = this;
    const reach = -dot(sub(place, camera.eye), camera.back) * factor;
    const isTooNear = !(reach > this.actions.least()) && factor < 1;
    const isTooFar = !(reach < this.actions.most()) && factor > 1;
    if (isTooNear || isTooFar || !(reach > 0)) return;
    camera.eye = add(place, scale(sub(camera.eye, place), factor));
    camera.target = sub(camera.eye, scale(camera.back, reach));
    camera.update();
  }

  #wheel(event) {
    event.preventDefault();
    const notches = clamp(event.deltaY / (event.deltaMode === 1 ? 3 : 100), -3, 3);
    if (this.isFlying) this.speed *= 1.2 ** -notches;
    else this.zoom(1.15 ** notches, this.#place(...this.#pixel(event)));
    this.actions.change();
    this.actions.rest();
  }

  /** Where the wheel leads to. It is looked up once per gesture: looking costs a drawing of all points. */
  #place(x, y) {
    const { camera, gesture } = this;
    const now = performance.now();
    const isHeld = gesture && this.#isUnder(gesture, x, y);
    const isNear = isHeld && distance(camera.eye, gesture.place) * GESTURE_NEARER < gesture.away;
    const isSame = isHeld && !isNear && now - gesture.time < GESTURE_MS;
    if (isSame) {
      gesture.time = now;
      return gesture.place;
    }
    const away = (to) => distance(camera.eye, to);
    const hit = this.actions.hit(x, y);
    // points grow apart: between them, and what is far behind, on to where it led before
    const isThrough = isHeld && (!hit || away(hit) > BEHIND * away(gesture.place));
    const place = isThrough ? gesture.place : (hit ?? onPlane(camera, camera.ray(x, y), camera.target));
    this.gesture = { x, y, place, time: now, away: away(place) };
    return place;
  }

  /** Whether the cursor is where it was, and the place still under it and not too near to be drawn. */
  #isUnder({ place, x: atX, y: atY }, x, y) {
    const { camera } = this;
    const pixel = camera.project(place);
    const most = GESTURE_PIXELS * this.#density;
    return pixel !== null && pixel[2] > camera.near && Math.hypot(pixel[0] - x, pixel[1] - y) < most && Math.hypot(atX - x, atY - y) < most;
  }

  #key(event, isDown) {
    const key = event.key.toLowerCase();
    // also with Ctrl, or after the flight: a key whose release is missed would fly for ever
    if (!isDown) {
      if (this.keys.delete(key)) this.actions.rest();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (this.isFlying && "wasdqe".includes(key) && key.length === 1) {
      this.keys.add(key);
      this.actions.change();
      event.preventDefault();
    } else if (this.#steer(key, event.shiftKey)) {
      event.preventDefault();
      this.#isPointed(false);
      this.actions.change();
      this.actions.rest();
    } else if (!event.repeat) this.actions.key(key);
  }

  /** Turns, moves or zooms by a key; false if it is none of these. */
  #steer(key, isShifted) {
    const [dx, dy] = (ARROWS[key] ?? [0, 0]).map((v) => v * KEY_PIXELS * this.#density);
    if (key in ARROWS) this[isShifted ? "pan" : "turn"](dx, dy);
    else if (key === "+" || key === "=") this.zoom(1.15 ** -KEY_NOTCHES);
    else if (key === "-") this.zoom(1.15 ** KEY_NOTCHES);
    else return false;
    return true;
  }

  /** Moves on while keys of flying are held; true if the picture changed. */
  fly(seconds) {
    if (!this.isFlying || this.keys.size === 0) return false;
    const { camera } = this;
    const along = { w: scale(camera.back, -1), s: camera.back, d: camera.right, a: scale(camera.right, -1), e: [0, 0, 1], q: [0, 0, -1] };
    const step = [...this.keys].reduce((sum, key) => add(sum, along[key]), [0, 0, 0]);
    const by = scale(unit(step, [0, 0, 0]), this.actions.pace() * this.speed * seconds);
    camera.eye = add(camera.eye, by);
    camera.target = add(camera.target, by);
    camera.update();
    return true;
  }
}

/** Where a ray meets the plane through `place` that faces the camera. */
export function onPlane(camera, direction, place) {
  const depth = -dot(sub(place, camera.eye), camera.back);
  const slope = -dot(direction, camera.back);
  return slope > 1e-9 ? add(camera.eye, scale(direction, depth / slope)) : place;
}
