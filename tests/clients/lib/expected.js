// What a client must find in a dataset, made from the scan alone and from what docs/formats says of the format.

import { range } from "./las.js";
import { Sums } from "../clients/sums.js";

/** A colour channel as clients of each format show it; `deep` says whether the scan has more than 8 bits. */
const CHANNEL = {
  // potree2.md §8 and §10: colours of 8 bits are stored × 257; clients divide what is above 255 by 256
  potree2: (value, deep) => {
    const stored = deep ? value : value * 257;
    return stored > 255 ? stored >> 8 : stored;
  },
  // potree1.md §7: the nearest of 8 bits
  potree1: (value, deep) => (deep ? Math.floor((255 * value + 32_767) / 65_535) : value),
  copc: (value, deep) => (deep ? value : value * 257),
};

/** Every nth point of a scan. */
function thin({ columns, ...scan }, every) {
  const kept = Object.entries(columns).map(([name, values]) => [name, values.filter((_, i) => i % every === 0)]);
  return { ...scan, columns: Object.fromEntries(kept) };
}

/**
 * The columns that are compared, with their sums; the box in world coordinates; the ranges of attributes by the names that
 * clients have.
 */
export function expected(source, format, every) {
  const { columns, scale, offset } = thin(source, every);
  const named = { x: columns.X, y: columns.Y, z: columns.Z };
  if (columns.r) {
    const deep = Math.max(...["r", "g", "b"].map((name) => range(columns[name])[1])) > 255;
    for (const name of ["r", "g", "b"]) named[name] = Array.from(columns[name], (value) => CHANNEL[format](value, deep));
  }
  if (!columns.r && format === "potree1") {
    // potree1.md §7: grey shows the intensity, from the least to the greatest
    const [least, greatest] = range(columns.intensity);
    const grey = Array.from(columns.intensity, (value) => Math.floor((255 * (value - least)) / (greatest - least) + 0.5));
    Object.assign(named, { r: grey, g: grey, b: grey });
  }
  Object.assign(named, { intensity: columns.intensity, classification: columns.classification });
  if (columns.time && format !== "potree1") named.time = columns.time;

  const names = Object.keys(named);
  const sums = new Sums(names);
  sums.add(columns.X.length, Object.values(named));
  const ends = ["X", "Y", "Z"].map((axis, i) => range(columns[axis]).map((value) => value * scale[i] + offset[i]));
  return {
    names,
    lattice: { scale, offset },
    sums: sums.result(),
    box: [ends.map(([least]) => least), ends.map(([, greatest]) => greatest)],
    ranges: {
      intensity: range(columns.intensity),
      classification: range(columns.classification),
      ...(columns.time && { "gps-time": range(columns.time) }),
    },
  };
}
