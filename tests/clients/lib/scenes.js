// Small scans, made the same on every run. Each has three balls of pure colours, at +x, +y and +z of its middle, by which
// a picture shows whether axes and colours are right.

import { readScan } from "./las.js";

/** mulberry32: numbers of 0 to 1, the same for the same seed. */
function random(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

const BALLS = [
  { name: "red", colour: [220, 30, 30], axis: 0 },
  { name: "green", colour: [30, 200, 40], axis: 1 },
  { name: "blue", colour: [40, 60, 230], axis: 2 },
];

/** Collects points in units from a middle, as integers on a lattice of step `scale` around `middle`. */
class Builder {
  constructor(format, scale, middle) {
    this.scan = { format, scale: [scale, scale, scale], offset: middle.map((m) => Math.round(m / scale) * scale) };
    this.columns = { X: [], Y: [], Z: [], intensity: [], classification: [], r: [], g: [], b: [], time: [] };
    this.balls = [];
  }

  point([x, y, z], [r, g, b], intensity, classification) {
    const scale = this.scan.scale[0];
    const { columns } = this;
    columns.time.push(250_000 + columns.X.length / 1024);
    columns.X.push(Math.round(x / scale));
    columns.Y.push(Math.round(y / scale));
    columns.Z.push(Math.round(z / scale));
    columns.intensity.push(intensity);
    columns.classification.push(classification);
    columns.r.push(r);
    columns.g.push(g);
    columns.b.push(b);
  }

  /** Balls of `radius` at `distance` from the middle; `depth` maps a colour of 8 bits to the colours of the scan. */
  addBalls(next, distance, radius, depth = (value) => value) {
    for (const { name, colour, axis } of BALLS) {
      const centre = [0, 0, 0];
      centre[axis] = distance;
      for (let i = 0; i < 3000; i++) {
        const [x, y, z] = onSphere(next);
        this.point([centre[0] + x * radius, centre[1] + y * radius, centre[2] + z * radius], colour.map(depth), 500 + axis, 6);
      }
      const world = centre.map((c, i) => c + this.scan.offset[i]);
      this.balls.push({ name, colour, centre: world, radius });
    }
  }

  build() {
    const { format } = this.scan;
    const { r, g, b, time, ...columns } = this.columns;
    if (format === 2 || format === 3) Object.assign(columns, { r, g, b });
    if (format === 1 || format === 3) columns.time = time;
    return { ...this.scan, columns, balls: this.balls };
  }
}

function onSphere(next) {
  const z = 2 * next() - 1;
  const angle = 2 * Math.PI * next();
  const radius = Math.sqrt(1 - z * z);
  return [radius * Math.cos(angle), radius * Math.sin(angle), z];
}

/**
 * A yard of 8 × 6 m with walls of 3 m on two sides, seen from its middle, as a scanner on a tripod does: density falls with the
 * square of the distance.
 */
function terrestrial() {
  const next = random(1);
  const half = [4, 3, 1.5];
  const builder = new Builder(3, 0.0001, [1000, 2000, 50]);
  for (let i = 0; i < 120_000; i++) {
    const ray = onSphere(next);
    const reach = half.map((h, axis) => h / Math.abs(ray[axis]));
    const side = reach.indexOf(Math.min(...reach));
    // open to the sky and to where pictures are taken from
    if (Math.sign(ray[side]) !== [-1, 1, -1][side]) continue;
    const range = reach[side] + (next() - 0.5) * 0.004;
    // 16 bits that are no multiples of 257; channels below 256 too, which viewers take for 8 bits
    const shade = i % 50 === 0 ? 200 : 20_000 + Math.floor(30_000 * next());
    builder.point(ray.map((r) => r * range), [shade, Math.floor(shade * 0.9), Math.floor(shade * 0.8)], Math.floor(65_535 / (1 + range)), 1);
  }
  builder.addBalls(next, 1.2, 0.25, (value) => value * 257);
  return builder.build();
}

/** A hilly patch of ground of `side` units with balls above it. */
function ground(format, scale, middle, side, seed, depth) {
  const next = random(seed);
  const builder = new Builder(format, scale, middle);
  for (let i = 0; i < 50_000; i++) {
    const [x, y] = [(next() - 0.5) * side, (next() - 0.5) * side];
    const z = side * 0.05 * (Math.sin((7 * x) / side) + Math.cos((5 * y) / side)) - side * 0.2;
    const green = 90 + Math.floor(100 * next());
    builder.point([x, y, z], [green + 20, green, 60].map(depth), Math.floor(4000 * next()), 2);
  }
  builder.addBalls(next, side * 0.3, side * 0.06, depth);
  return builder.build();
}

/**
 * Dust: clusters of clusters, which the tree follows far down through nodes of few points. More nodes than a chunk of the
 * hierarchy holds are below one of level 8, so that its chunk has chunks below it.
 */
function deep() {
  const next = random(5);
  const builder = new Builder(2, 0.0001, [500_000, 5_400_000, 400]);
  const colours = BALLS.map(({ colour }) => colour);
  const spread = (centre, size, counts, shrink) => {
    const [count, ...rest] = counts;
    for (let i = 0; i < count; i++) {
      const at = centre.map((c) => c + (next() - 0.5) * size);
      if (rest.length > 0) spread(at, size / shrink, rest, shrink);
      else builder.point(at, colours[i % 3], i, 3);
    }
  };
  spread([0, 0, 0], 400, [8, 8, 8, 7, 2], 6);
  spread([71, 81, 62], 0.8, [10, 10, 10, 8, 2], 6);
  return builder.build();
}

function single() {
  const builder = new Builder(2, 0.01, [10, 20, 30]);
  builder.point([0, 0, 0], [255, 128, 7], 9, 5);
  return builder.build();
}

/** Name → the scan, with the balls that are in it. */
export const SCENES = {
  aerial: () => readScan(new URL("../../../fixtures/las/autzen_trim.laz", import.meta.url)),
  terrestrial,
  ecef: () => ground(2, 0.001, [4_075_543.123, 931_735.456, 4_801_629.789], 120, 2, (value) => value * 257),
  nocolour: () => ground(1, 0.01, [3000, -2000, 100], 200, 3, (value) => value),
  eightbit: () => ground(2, 0.01, [-3000, 2000, -100], 200, 4, (value) => value),
  single,
  deep,
};
