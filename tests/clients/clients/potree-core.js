import { PointColorType, PointSizeType, Potree } from "potree-core";
import { loadAll } from "./octree.js";
import { showCloud } from "./show.js";
import { fetchWhole } from "./whole.js";

/** ColorEncoding.SRGB, which the package does not export. */
const SRGB = 1;

/** Shows the dataset at `url`, then loads all of it. `job` is explained in run.js. */
window.run = async (job) => {
  const potree = new Potree();
  const name = job.format === "potree1" ? "cloud.js" : "metadata.json";
  const requests = { getUrl: async (path) => `${job.url}/${path}`, fetch: job.whole ? fetchWhole : (...request) => fetch(...request) };
  const cloud = await potree.loadPointCloud(name, requests);
  cloud.material.outputColorEncoding = SRGB; // its default is linear, for pipelines that encode at the end
  const shown = job.draw && (await showCloud(potree, cloud, job, { PointColorType, PointSizeType }));
  return { ...shown, ...(await loadAll(cloud, job)) };
};
