// Which scene becomes which dataset, and which clients read it.

import { POTREE } from "./browser.js";

const itself = POTREE ? ["potree"] : [];
const BOTH = ["potree-core", "three-loader", ...itself];
const CORE = ["potree-core", ...itself]; // three-loader has no Brotli
const COPC = ["copc"];

/** Options of `convert` for each kind of dataset. */
const KINDS = {
  potree2: { args: ["--to", "potree2"], clients: BOTH },
  brotli: { args: ["--to", "potree2", "--encoding", "brotli"], clients: CORE },
  potree1: { args: ["--to", "potree1", "--attributes", "rgb,intensity,classification"], clients: BOTH },
  copc: { args: ["--to", "copc"], clients: COPC },
};

/** Nodes of at most two points, at a distance that makes many of them. */
const DEEP = ["--leaf-capacity", "2", "--spacing", "22"];

/** Where a scene needs other options than its kind. */
const OPTIONS = {
  nocolour: { potree1: ["--attributes", "intensity,classification"] },
  deep: { potree2: DEEP, copc: DEEP, potree1: [...DEEP, "--every", "16"] }, // a file for each node takes long to sync
};

/** The least number of chunks of the hierarchy that must be below one another. */
const CHUNKS = { deep: { potree2: 3, potree1: 3, copc: 3 } };

/** The datasets: name, scene, kind, options of `convert`, clients, chunks, and every which point is kept. */
export const DATASETS = ["aerial", "terrestrial", "ecef", "nocolour", "eightbit", "single", "deep"].flatMap((scene) =>
  Object.entries(KINDS)
    .filter(([kind]) => scene !== "deep" || kind !== "brotli") // the index is that of DEFAULT
    .map(([kind, { args, clients }]) => {
      const options = OPTIONS[scene]?.[kind] ?? [];
      const every = options.includes("--every") ? Number(options[options.indexOf("--every") + 1]) : 1;
      const format = kind === "brotli" ? "potree2" : kind;
      const chunks = CHUNKS[scene]?.[kind] ?? 1;
      return { name: `${scene}-${kind}`, scene, format, args: merged(args, options), clients, chunks, every };
    }),
);

/** Seconds for one client and one dataset, when all else is slow, too. The deep ones have ten thousand nodes. */
export const seconds = ({ scene }) => (scene === "deep" ? 150 : 40);

/** The options of a kind and those of a scene, which win. */
function merged(args, options) {
  const kept = options.includes("--attributes") ? args.slice(0, args.indexOf("--attributes")) : args;
  return [...kept, ...options];
}
