import { Copc } from "copc";
import { createLazPerf } from "laz-perf";
import { BufferAttribute, BufferGeometry, Points, PointsMaterial } from "three";
import { Lattice } from "./lattice.js";
import { picture, stage } from "./show.js";
import { Sums } from "./sums.js";
import { rangesOf } from "./whole.js";

/** The dimension of LAS for each column. */
const DIMENSIONS = {
  x: "X",
  y: "Y",
  z: "Z",
  r: "Red",
  g: "Green",
  b: "Blue",
  intensity: "Intensity",
  classification: "Classification",
  time: "GpsTime",
};

/** Loads the COPC file at `url`, page by page and node by node, and draws it. `job` is explained in run.js. */
window.run = async (job) => {
  const lazPerf = await createLazPerf({ locateFile: () => "/laz-perf.wasm" });
  const url = new URL(job.url, location).href;
  const source = job.whole ? rangesOf(url) : url;
  const copc = await Copc.create(source);
  const { nodes, pages } = await hierarchy(source, copc.info.rootHierarchyPage);
  const steps = new Lattice(job.lattice);
  const sums = new Sums(job.columns);
  const view = job.draw && stage(job.box);
  let depth = 0;
  for (const [key, node] of Object.entries(nodes)) {
    const decoded = await Copc.loadPointDataView(source, copc, node, { lazPerf, include: Object.values(DIMENSIONS) });
    if (decoded.pointCount !== node.pointCount) throw new Error(`${key}: ${decoded.pointCount} points, its entry says ${node.pointCount}`);
    const columns = pointColumns(decoded, key, copc, job.columns, steps);
    sums.add(node.pointCount, columns);
    if (job.draw) view.scene.add(points(job, columns));
    depth = Math.max(depth, Number(key.split("-")[0]));
  }
  const { cube, pointCount } = { ...copc.info, ...copc.header };
  return {
    nodes: Object.keys(nodes).length,
    depth,
    chunks: pages,
    worst: steps.worst,
    sums: sums.result(),
    declared: pointCount,
    cube: [cube.slice(0, 3), cube.slice(3)],
    box: [copc.header.min, copc.header.max],
    ranges: { "gps-time": copc.info.gpsTimeRange },
    shown: sums.count,
    picture: job.draw && picture(view, job.balls),
  };
};

/** All nodes of the page and of those that it leads to; `pages` says how far pages lead on. */
async function hierarchy(source, page) {
  const { nodes, pages } = await Copc.loadHierarchyPage(source, page);
  let below = 0;
  for (const next of Object.values(pages)) {
    const more = await hierarchy(source, next);
    Object.assign(nodes, more.nodes);
    below = Math.max(below, more.pages);
  }
  return { nodes, pages: 1 + below };
}

function pointColumns(view, key, { info }, names, steps) {
  const [level, ...cell] = key.split("-").map(Number);
  const side = (info.cube[3] - info.cube[0]) / 2 ** level;
  const corner = cell.map((index, axis) => info.cube[axis] + index * side);
  const read = (name) => {
    const get = view.getter(DIMENSIONS[name]);
    return Float64Array.from({ length: view.pointCount }, (_, i) => get(i));
  };
  const world = ["x", "y", "z"].map(read);
  const relative = Float64Array.from({ length: 3 * view.pointCount }, (_, i) => world[i % 3][Math.floor(i / 3)] - corner[i % 3]);
  const [x, y, z] = steps.integers(relative, corner, { name: key, level, side });
  return names.map((name) => ({ x, y, z })[name] ?? read(name));
}

/** The points of a node for three.js, relative to the middle of the scene. */
function points({ columns: names, lattice, box }, columns) {
  const geometry = new BufferGeometry();
  const column = (name) => columns[names.indexOf(name)];
  const count = columns[0].length;
  const middle = box[0].map((value, axis) => (value + box[1][axis]) / 2);
  const places = ["x", "y", "z"].map((name, axis) => column(name).map((v) => v * lattice.scale[axis] + lattice.offset[axis] - middle[axis]));
  const greys = column("intensity");
  const brightest = greys.reduce((a, b) => Math.max(a, b), 1);
  const colours = ["r", "g", "b"].map((name) => column(name)?.map((v) => v / 65_535) ?? greys.map((v) => v / brightest));
  const interleaved = (parts) => new BufferAttribute(Float32Array.from({ length: 3 * count }, (_, i) => parts[i % 3][Math.floor(i / 3)]), 3);
  geometry.setAttribute("position", interleaved(places));
  geometry.setAttribute("color", interleaved(colours));
  const object = new Points(geometry, new PointsMaterial({ vertexColors: true, size: 3, sizeAttenuation: false }));
  object.position.set(...middle);
  object.frustumCulled = false;
  return object;
}
