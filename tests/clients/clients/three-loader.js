import { PointColorType, PointSizeType, Potree } from "@pnext/three-loader";
import { loadAll } from "./octree.js";
import { showCloud } from "./show.js";
import { fetchWhole } from "./whole.js";

/** Shows the dataset at `url`, then loads all of it. `job` is explained in run.js. */
window.run = async (job) => {
  const [version, name] = job.format === "potree1" ? ["v1", "cloud.js"] : ["v2", "metadata.json"];
  const potree = new Potree(version);
  const cloud = await potree.loadPointCloud(name, (path) => `${job.url}/${path}`, job.whole ? fetchWhole : undefined);
  const shown = job.draw && (await showCloud(potree, cloud, job, { PointColorType, PointSizeType }));
  return { ...shown, ...(await loadAll(cloud, job)) };
};
