// Potree itself, as its releases are built: a script that makes `Potree`. Its viewer is not used, so there is no picture.

import { loadAll } from "./octree.js";
import { fetchWhole } from "./whole.js";

/** Loads all of the dataset at `url`. `job` is explained in run.js. */
window.run = async (job) => {
  const { Potree } = window;
  Potree.maxNodesLoading = Infinity;
  if (job.whole) window.fetch = fetchWhole;
  const name = job.format === "potree1" ? "cloud.js" : "metadata.json";
  const { pointcloud } = await Potree.loadPointCloud(new URL(`${job.url}/${name}`, location).href, "cloud");
  return loadAll(pointcloud, job);
};
