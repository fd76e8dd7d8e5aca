// Values of attributes out of bytes, and points as the clouds take them.

import { HAS } from "pm/sources/units.js";

const READERS = {
  int8: ["getInt8", 1], uint8: ["getUint8", 1], int16: ["getInt16", 2], uint16: ["getUint16", 2], int32: ["getInt32", 4],
  uint32: ["getUint32", 4], int64: ["getBigInt64", 8], uint64: ["getBigUint64", 8], float: ["getFloat32", 4], double: ["getFloat64", 8],
};

export const sizeOf = (type) => READERS[type]?.[1] ?? 0;

/** A function of (point, element): values of an attribute whose first one is at `start`, `stride` bytes from point to point. */
export function column(view, type, start, stride) {
  const [name, size] = READERS[type] ?? [];
  if (!name) throw new Error(`attributes of type ${type} are not known`);
  const get = view[name].bind(view);
  const raw = (point, element = 0) => get(start + point * stride + element * size, true);
  const value = (point, element) => Number(raw(point, element));
  value.raw = raw; // a BigInt of 64 bits
  return value;
}

/** Least and greatest meant values, of the stored ones that formats give; nothing if these are not there, or no numbers. */
export function meant({ min, max, scale, offset, elements }) {
  const ends = Array.from({ length: elements }, (_, e) => [min, max].map((all) => Number(all?.[e] ?? NaN) * (scale?.[e] ?? 1) + (offset?.[e] ?? 0)));
  if (!ends.flat().every(Number.isFinite)) return { min: undefined, max: undefined };
  return { min: ends.map((pair) => Math.min(...pair)), max: ends.map((pair) => Math.max(...pair)) }; // a scale may be negative
}

/** 8 bits of a channel: the nearest of 255 parts. */
export const eightBit = (v) => Math.floor((v * 255 + 32767) / 65535);

/** The greatest integer of a place: shaders take no larger ones. */
const MOST_INTEGER = 2 ** 31 - 1;

/**
 * Points from functions of their number. `integer`: the lattice's integers; or else `world`: coordinates, put on 2^31 steps of
 * their box, as integers are that need more. The others may be missing. Of `stored` points the first of every `every` is taken.
 */
export function makePoints(stored, { every = 1, integer, scale, offset, world, colour, classification, intensity, extra, extraBase = 0 }) {
  const count = Math.ceil(stored / every);
  const at = (of) => of && ((i, e) => of(i * every, e));
  [integer, world, colour, classification, intensity, extra] = [integer, world, colour, classification, intensity, extra].map(at);
  const place = integer ?? world;
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < count; i++) {
    for (let a = 0; a < 3; a++) {
      const v = place(i, a);
      if (v < low[a]) low[a] = v;
      if (v > high[a]) high[a] = v;
    }
  }
  if (count === 0) low.fill(0);
  const extent = low.map((v, a) => (count === 0 ? 0 : high[a] - v));
  const isWide = !integer || Math.max(...extent) > 65535;
  const isExact = integer && Math.max(...extent) <= MOST_INTEGER;
  const cell = extent.map((e) => (isExact || e === 0 ? 1 : e / MOST_INTEGER));
  const step = integer ? cell.map((c, a) => c * scale[a]) : cell;
  const origin = integer ? low.map((v, a) => v * scale[a] + offset[a]) : low;
  const places = isWide ? new Uint32Array(4 * count) : new Uint16Array(4 * count);
  const colours = new Uint8Array(4 * count);
  const extras = extra ? new Float32Array(count) : null;
  for (let i = 0; i < count; i++) {
    for (let a = 0; a < 3; a++) places[4 * i + a] = Math.round((place(i, a) - low[a]) / cell[a]);
    if (intensity) places[4 * i + 3] = intensity(i);
    if (colour) for (let c = 0; c < 3; c++) colours[4 * i + c] = colour(i, c);
    if (classification) colours[4 * i + 3] = classification(i);
    if (extras) extras[i] = extra(i) - extraBase;
  }
  const has = (isWide ? HAS.WIDE : 0) | (colour ? HAS.COLOUR : 0) | (extra ? HAS.EXTRA : 0) | (classification ? HAS.CLASS : 0) | (intensity ? HAS.INTENSITY : 0);
  return { count, stored, isWide, origin, step, places, colours, extra: extras, has };
}

/** What makes points of columns that have the names of LAS. `find` gives the column of an attribute, or nothing. */
export function usual(attributes, find, attribute) {
  const of = (name) => attributes.find((each) => each.name === name);
  const rgb = find("rgb") ?? find("rgba");
  const own = of("rgb") ?? of("rgba");
  const isWords = own && sizeOf(own.type) > 1 && !(own.max && Math.max(...own.max.slice(0, 3)) <= 255);
  const scaled = attribute && of(attribute);
  const raw = attribute && find(attribute);
  const value = (i) => raw(i) * (scaled.scale?.[0] ?? 1) + (scaled.offset?.[0] ?? 0);
  return {
    colour: rgb && (isWords ? (i, c) => eightBit(rgb(i, c)) : rgb),
    classification: find("classification"),
    intensity: find("intensity"),
    extra: raw && value,
    extraBase: scaled?.min?.[0] ?? 0,
  };
}

/** Everything of a point, for people. */
export function everything(position, attributes, find, index) {
  return {
    position,
    attributes: attributes.map(({ name, elements, scale, offset }) => {
      const get = find(name);
      const each = Array.from({ length: elements }, (_, e) => ({ raw: get.raw?.(index, e), value: get(index, e), scale: scale?.[e] ?? 1, offset: offset?.[e] ?? 0 }));
      const values = each.map((own) => own.value * own.scale + own.offset);
      const texts = each.filter((own) => own.scale === 1 && own.offset === 0 && !isExact(own)).map((own) => String(own.raw ?? own.value));
      return texts.length > 0 ? { name, values, text: texts.join(" ") } : { name, values };
    }),
  };
}

/** A number of JavaScript says it. */
const isExact = ({ raw, value }) => Number.isFinite(value) && (typeof raw !== "bigint" || Math.abs(value) <= 2 ** 53);
