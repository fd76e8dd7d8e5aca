// Points of a unit on the graphics card.

import { buffer } from "pm/gl/context.js";
import { HAS } from "pm/sources/units.js";

/** Locations of the attributes, in the order in which programs are linked with them. */
export const POINT_ATTRIBUTES = ["aPlace", "aColour", "aExtra"];
export const BATCH_ATTRIBUTES = ["aHi", "aMid", "aLo", "aColour", "aIndex", "aExtra"];

/** Of octrees and binary trees. */
export function pointBlock(gl, points) {
  const block = begin(gl, points.count);
  block.whole(0, points.places, 4, points.isWide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT);
  block.add(points.colours);
  gl.enableVertexAttribArray(1);
  gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 0, 0);
  if (points.extra) block.extra(2, points.extra);
  return block.end({ origin: points.origin, step: points.step, stored: points.stored, classes: classes(points) });
}

/** Of batches. */
export function batchBlock(gl, points) {
  const block = begin(gl, points.count);
  points.planes.forEach((plane, at) => block.whole(at, plane, 1, gl.UNSIGNED_INT));
  block.whole(3, points.colours, 4, gl.UNSIGNED_BYTE);
  block.whole(4, points.indices, 1, gl.UNSIGNED_SHORT);
  if (points.extra) block.extra(5, points.extra);
  // a copy: a view would keep the whole answer
  const indices = points.indices.slice();
  return block.end({ min: points.min, sides: points.sides, planes: points.planes.length, indices }, indices.byteLength);
}

/** The classes of the points. */
function classes({ colours, has }) {
  const met = new Set();
  for (let at = 3; at < colours.length && has & HAS.CLASS; at += 4) met.add(colours[at]);
  return met;
}

function range(values) {
  if (!values) return null;
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : null;
}

function begin(gl, count) {
  const vao = gl.createVertexArray();
  gl.bindVertexArray(vao);
  const buffers = [];
  let bytes = 0;
  let extra;
  const add = (data) => {
    buffers.push(buffer(gl, data));
    bytes += data.byteLength;
  };
  return {
    add,
    whole(at, data, size, type) {
      add(data);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribIPointer(at, size, type, 0, 0);
    },
    extra(at, data) {
      add(data);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, 1, gl.FLOAT, false, 0, 0);
      extra = { at, buffer: buffers.pop(), bytes: data.byteLength, range: range(data) };
    },
    /** `kept`: bytes beside those on the card. */
    end(rest, kept = 0) {
      gl.bindVertexArray(null);
      const block = { vao, count, bytes: bytes + kept, extraRange: extra?.range ?? null, ...rest };
      block.dropExtra = () => {
        Object.assign(block, { attribute: undefined, extraRange: null });
        if (!extra) return;
        gl.bindVertexArray(vao);
        gl.disableVertexAttribArray(extra.at);
        gl.bindVertexArray(null);
        gl.deleteBuffer(extra.buffer);
        block.bytes -= extra.bytes;
        extra = undefined;
      };
      block.free = () => {
        buffers.concat(extra?.buffer ?? []).forEach((made) => gl.deleteBuffer(made));
        gl.deleteVertexArray(vao);
      };
      return block;
    },
  };
}
