import { PointColorType, PointSizeType, Potree } from "potree-core";
import { loadAll } from "./octree.js";
import { picture, stage, watch } from "./show.js";
import { fetchWhole } from "./whole.js";

/** ColorEncoding.SRGB, which the package does not export. */
const SRGB = 1;

/** Shows the dataset at `url`, then loads all of it. `job` is explained in run.js. */
window.run = async (job) => {
  const potree = new Potree();
  const name = job.format === "potree1" ? "cloud.js" : "metadata.json";
  const requests = { getUrl: async (path) => `${job.url}/${path}`, fetch: job.whole ? fetchWhole : (...request) => fetch(...request) };
  const cloud = await potree.loadPointCloud(name, requests);
  const shown = job.draw && (await show(potree, cloud, job));
  return { ...shown, ...(await loadAll(cloud, job)) };
};

async function show(potree, cloud, job) {
  const view = stage(job.box);
  const { material } = cloud;
  material.pointSizeType = PointSizeType.FIXED;
  material.size = 3;
  material.outputColorEncoding = SRGB; // its default is linear, for pipelines that encode at the end
  if (job.colourBy) material.pointColorType = PointColorType[job.colourBy];
  if (job.intensity) material.intensityRange = job.intensity;
  const watched = await watch(potree, cloud, view, job.points);
  return { ...watched, picture: picture(view, job.balls) };
}
