// What the pages of Potree, potree-core and three-loader have in common: these are made from that, and their nodes look alike.

import { Lattice } from "./lattice.js";
import { Sums } from "./sums.js";

const AT_ONCE = 6; // as many requests as a browser sends to one host
const PATIENCE = 10_000; // milliseconds for one node

/** Workers that failed. The clients do not listen, and would wait for their answer for ever. */
const workerErrors = [];
const NativeWorker = globalThis.Worker;
globalThis.Worker = class extends NativeWorker {
  constructor(...options) {
    super(...options);
    this.addEventListener("error", (event) => workerErrors.push(event.message));
  }
};

/**
 * Loads every node of `cloud`, whatever a camera would see, and returns what came: nodes, depth, chunks of the
 * hierarchy below one another, sums of the points.
 * `columns` are the names of what is compared, `lattice` is that of the scan, `slack` what the format rounds (world units).
 */
export async function loadAll(cloud, { columns, lattice, slack }) {
  const geometry = cloud.pcoGeometry;
  geometry.maxNumNodesLoading = Infinity;
  const steps = new Lattice(lattice, slack);
  const sums = new Sums(columns);
  const corner = geometry.offset.toArray();
  let [nodes, depth, chunks] = [0, 0, 0];

  const visit = async (node) => {
    await load(node);
    nodes += 1;
    depth = Math.max(depth, node.level);
    chunks = Math.max(chunks, chunksAbove(node));
    sums.add(node.numPoints, pointColumns(node, corner, columns, steps));
  };
  for (let level = [geometry.root]; level.length > 0; level = level.flatMap((node) => Object.values(node.children)).filter(Boolean).map(plain)) {
    const queue = [...level];
    const take = async () => {
      while (queue.length > 0) await visit(queue.pop());
    };
    await Promise.all(Array.from({ length: AT_ONCE }, take));
  }
  return { nodes, depth, chunks, worst: steps.worst, sums: sums.result(), ...description(geometry) };
}

/** How many chunks of the hierarchy (files, in Potree 1) were needed to know this node and its children. */
function chunksAbove(node) {
  if (!node) return 0;
  const step = node.pcoGeometry?.hierarchyStepSize;
  const begins = step ? node.level % step === 0 && node.hasChildren : node.hierarchyByteOffset !== undefined;
  return chunksAbove(node.parent) + (begins ? 1 : 0);
}

/** The node as it was loaded, also if it is in the scene, where another object stands for it. */
const plain = (node) => node.geometryNode ?? node;

async function load(node) {
  const until = performance.now() + PATIENCE;
  // a load that is refused or fails is not an error to the clients, but leaves the node as it was
  node.load()?.catch?.((reason) => (node.reason = reason));
  while (!node.loaded) {
    if (workerErrors.length > 0) throw new Error(`${node.name}: a worker failed: ${workerErrors[0]}`);
    await new Promise((resolve) => setTimeout(resolve));
    if (!node.loaded && !node.loading) throw new Error(`${node.name}: not loaded: ${node.reason ?? "without a reason"}`);
    if (performance.now() > until) throw new Error(`${node.name}: not loaded within ${PATIENCE / 1000} s`);
  }
}

/** The columns of the points of a node, positions as integers of the scan. */
function pointColumns(node, origin, columns, steps) {
  const { attributes } = node.geometry;
  const box = node.boundingBox; // relative to the corner of the cloud
  const corner = box.min.toArray().map((value, axis) => value + origin[axis]);
  const side = Math.max(...box.max.toArray().map((value, axis) => value - box.min.toArray()[axis]));
  if (attributes.position.count !== node.numPoints) {
    throw new Error(`${node.name}: ${attributes.position.count} points, the hierarchy says ${node.numPoints}`);
  }
  const [x, y, z] = steps.integers(attributes.position.array, corner, { name: node.name, level: node.level, side });
  const colour = attributes.rgba ?? attributes.color;
  const channel = (k) => Uint8Array.from({ length: node.numPoints }, (_, i) => colour.array[colour.itemSize * i + k]);
  const values = {
    x: () => x,
    y: () => y,
    z: () => z,
    r: () => channel(0),
    g: () => channel(1),
    b: () => channel(2),
    intensity: () => scalar(attributes.intensity),
    classification: () => scalar(attributes.classification),
    time: () => scalar(attributes["gps-time"]),
  };
  return columns.map((name) => values[name]());
}

/** What the file says; the shader gets doubles as parts of their range. */
const scalar = (attribute) => attribute.potree?.preciseBuffer ?? attribute.array;

/** What the client knows of the cloud without its nodes, in world coordinates. */
function description({ offset, boundingBox, tightBoundingBox, pointAttributes }) {
  const world = ({ min, max }) => [min, max].map((corner) => corner.toArray().map((value, axis) => value + offset.toArray()[axis]));
  const ranges = (pointAttributes.attributes ?? []).filter(({ numElements, range }) => numElements === 1 && range?.every(Number.isFinite));
  return {
    cube: world(boundingBox),
    box: world(tightBoundingBox),
    ranges: Object.fromEntries(ranges.map(({ name, range }) => [name, range])),
  };
}
