// What a source hands to a cloud, whichever bytes it came from.
//
// A *unit* is what is loaded at once: a node of an octree, a leaf of a binary tree, a batch.
//
// Points of octrees and binary trees:
//   { count, stored, isWide, origin, step, places, colours, extra, has }
//   places: x, y, z, intensity per point, Uint16Array or (isWide) Uint32Array; world = origin + integer · step
//   colours: r, g, b, class per point; extra: Float32Array (value - minimum of the attribute) or null
// Points of batches:
//   { count, stored, planes: [hi, mid, lo], colours, indices, extra, min, sides }

const HEADER = 64;

export const HAS = { WIDE: 1, COLOUR: 2, EXTRA: 4, CLASS: 8, INTENSITY: 16 };

const three = (view, at) => [0, 8, 16].map((k) => view.getFloat64(at + k, true));

/** The blocks of an answer: [view at a header, byte of its body]. */
function* blocks(bytes) {
  let at = 0;
  while (at < bytes.byteLength) {
    if (at + HEADER > bytes.byteLength) throw new Error("the answer ends within a header");
    const view = new DataView(bytes, at, HEADER);
    const body = view.getUint32(56, true);
    if (at + HEADER + body > bytes.byteLength) throw new Error("the answer ends within points");
    yield [view, at + HEADER];
    at += HEADER + body;
  }
}

export function readPoints(bytes) {
  return [...blocks(bytes)].map(([view, at]) => {
    const [count, flags] = [view.getUint32(0, true), view.getUint32(4, true)];
    const isWide = (flags & HAS.WIDE) !== 0;
    const places = isWide ? new Uint32Array(bytes, at, 4 * count) : new Uint16Array(bytes, at, 4 * count);
    const colours = new Uint8Array(bytes, at + places.byteLength, 4 * count);
    const extra = flags & HAS.EXTRA ? new Float32Array(bytes, at + places.byteLength + 4 * count, count) : null;
    return { count, stored: view.getUint32(60, true), isWide, origin: three(view, 8), step: three(view, 32), places, colours, extra, has: flags };
  });
}

export function readBatches(bytes) {
  return [...blocks(bytes)].map(([view, body]) => {
    const [count, flags] = [view.getUint32(0, true), view.getUint32(4, true)];
    let at = body;
    const words = () => {
      const made = new Uint32Array(bytes, at, count);
      at += 4 * count;
      return made;
    };
    const planes = Array.from({ length: flags & 3 }, words);
    const { buffer, byteOffset, byteLength } = words();
    const colours = new Uint8Array(buffer, byteOffset, byteLength);
    const indices = new Uint16Array(bytes, at, count);
    at += Math.ceil(count / 2) * 4;
    const extra = flags & HAS.EXTRA ? new Float32Array(bytes, at, count) : null;
    return { count, stored: view.getUint32(60, true), planes, colours, indices, extra, min: three(view, 8), sides: three(view, 32) };
  });
}

/** Nodes of a chunk, in the order of their names: { name, points, mask, isProxy }. */
export function readNodes(bytes, root) {
  const view = new DataView(bytes);
  const count = checkNodes(view);
  const nodes = [{ name: root }];
  for (let i = 0; i < count; i++) {
    const at = 8 + 8 * i;
    const node = nodes[i];
    if (!node) throw new Error(`the index below ${root} is no tree`);
    const mask = view.getUint8(at + 4);
    Object.assign(node, { points: view.getUint32(at, true), mask, isProxy: (view.getUint8(at + 5) & 1) !== 0 });
    for (let child = 0; child < 8 && !node.isProxy; child++) {
      if ((mask >> child) & 1) nodes.push({ name: node.name + child });
    }
  }
  if (nodes.length !== count) throw new Error(`the index below ${root} is no tree`);
  return nodes;
}

/** Boxes of leaves or batches: { unit, box, points, lods }. */
export function readBoxes(bytes) {
  const view = new DataView(bytes);
  return Array.from({ length: checkNodes(view) }, (_, i) => {
    const at = 8 + 64 * i;
    const lods = [0, 1, 2, 3].map((lod) => view.getUint16(at + 56 + 2 * lod, true));
    return {
      unit: view.getUint32(at + 52, true),
      box: { min: three(view, at), max: three(view, at + 24) },
      points: view.getUint32(at + 48, true),
      lods,
    };
  });
}

function checkNodes(view) {
  if (view.byteLength < 8 || view.getUint32(0, false) !== 0x504d4e31) throw new Error("the answer is no index");
  return view.getUint32(4, true);
}
