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
  if (points.extra) block.single(2, points.extra);
  return block.end({ origin: points.origin, step: points.step, stored: points.stored, extraRange: range(points.extra), classes: classes(points) });
}

/** Of batches. */
export function batchBlock(gl, points) {
  const block = begin(gl, points.count);
  points.planes.forEach((plane, at) => block.whole(at, plane, 1, gl.UNSIGNED_INT));
  block.whole(3, points.colours, 4, gl.UNSIGNED_BYTE);
  block.whole(4, points.indices, 1, gl.UNSIGNED_SHORT);
  if (points.extra) block.single(5, points.extra);
  return block.end({ min: points.min, sides: points.sides, planes: points.planes.length, indices: points.indices.slice(), extraRange: range(points.extra) });
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
    single(at, data) {
      add(data);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, 1, gl.FLOAT, false, 0, 0);
    },
    end(rest) {
      gl.bindVertexArray(null);
      const free = () => {
        buffers.forEach((made) => gl.deleteBuffer(made));
        gl.deleteVertexArray(vao);
      };
      return { vao, count, bytes, free, ...rest };
    },
  };
}
