// Faults that are planted in sound datasets on every run, to see that the comparison finds them.

import { cpSync, readdirSync, readFileSync, rmSync, truncateSync, writeFileSync } from "node:fs";
import { join } from "node:path";

/** Changes a file in place. */
const edit = (file, change) => (folder) => {
  const path = join(folder, file);
  const bytes = readFileSync(path);
  writeFileSync(path, change(bytes) ?? bytes);
};

const json = (file, change) =>
  edit(file, (bytes) => {
    const value = JSON.parse(bytes);
    change(value);
    return JSON.stringify(value);
  });

/** Where the colour begins in a record of Potree 2.0: behind the position. */
const COLOUR = 12;

/** `what` is planted into `dataset` by `plant(folder)`; one of the differences must match `found`, in a picture if `draw` is set. */
export const FAULTS = [
  {
    dataset: "eightbit-potree2",
    what: "the last byte of octree.bin is missing",
    plant: (folder) => truncateSync(join(folder, "octree.bin"), readFileSync(join(folder, "octree.bin")).length - 1),
    found: /a worker failed|not loaded/,
  },
  {
    dataset: "eightbit-potree2",
    what: "a bit of a red channel is wrong",
    plant: edit("octree.bin", (bytes) => void (bytes[COLOUR + 1] ^= 1)),
    found: /^r: /,
  },
  {
    dataset: "eightbit-potree2",
    what: "a point is a step off",
    plant: edit("octree.bin", (bytes) => void (bytes[0] ^= 1)),
    found: /^x: /,
  },
  {
    dataset: "eightbit-potree2",
    what: "a node is missing in the hierarchy",
    plant: edit("hierarchy.bin", (bytes) => void (bytes[1] &= bytes[1] - 1)),
    found: /^nodes: |not loaded/,
  },
  {
    dataset: "eightbit-potree2",
    what: "two points have changed their intensities",
    plant: edit("octree.bin", swapIntensities),
    found: /^points are put together/,
  },
  {
    dataset: "eightbit-potree2",
    what: "the range of intensity is too small",
    plant: json("metadata.json", ({ attributes }) => (attributes.find(({ name }) => name === "intensity").max[0] -= 1)),
    found: /^range of intensity/,
  },
  {
    dataset: "eightbit-potree2",
    what: "the cloud is a metre to the east",
    plant: json("metadata.json", (metadata) => {
      for (const corner of [metadata.offset, metadata.boundingBox.min, metadata.boundingBox.max]) corner[0] += 1;
    }),
    found: /^x: /,
  },
  {
    dataset: "eightbit-brotli",
    what: "a byte of a Brotli stream is wrong",
    plant: edit("octree.bin", (bytes) => void (bytes[bytes.length - 100] ^= 0xff)),
    found: /problem with node|hash/,
  },
  {
    dataset: "eightbit-potree1",
    what: "a node's file is missing",
    plant: (folder) => rmSync(join(folder, "data/r/r0.bin")),
    found: /the server answered 404/,
  },
  {
    dataset: "eightbit-potree1",
    what: "blue and red have changed places in a point",
    plant: edit("data/r/r.bin", (bytes) => void bytes.set([bytes[14], bytes[13], bytes[12]], 12)),
    found: /^r: /,
  },
  {
    dataset: "eightbit-potree1",
    what: "blue and red have changed places in all points",
    draw: true,
    plant: (folder) => {
      for (const name of readdirSync(join(folder, "data/r")).filter((name) => name.endsWith(".bin"))) edit(`data/r/${name}`, swapAll)(folder);
    },
    found: /^the red ball is at/,
  },
  {
    dataset: "eightbit-copc",
    what: "a byte of a compressed chunk is wrong",
    plant: edit("points.copc.laz", (bytes) => void (bytes[Math.floor(bytes.length / 2)] ^= 0xff)),
    found: /hash/,
  },
];

/** Exchanges red and blue in all points of a node of Potree 1: 12 bytes of position, 4 of colour, 2 of intensity, 1 of class. */
function swapAll(bytes) {
  for (let at = 12; at < bytes.length; at += 19) bytes.set([bytes[at + 2], bytes[at + 1], bytes[at]], at);
}

/** The first two points whose intensities differ exchange them: ranges and hashes of columns stay as they were. */
function swapIntensities(bytes) {
  const stride = bytes.length / 59_000;
  const at = COLOUR + 6;
  for (let i = at; ; i += stride) {
    const [one, other] = [bytes.readUInt16LE(i), bytes.readUInt16LE(i + stride)];
    if (one === other) continue;
    bytes.writeUInt16LE(other, i);
    bytes.writeUInt16LE(one, i + stride);
    return;
  }
}

/** Copies the dataset in `from` to `to`, and plants the fault there. */
export function plant({ plant }, from, to) {
  rmSync(to, { recursive: true, force: true });
  cpSync(from, to, { recursive: true });
  plant(to);
}
