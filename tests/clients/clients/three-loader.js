import { PointColorType, PointSizeType, Potree } from "@pnext/three-loader";
import { loadAll } from "./octree.js";
import { picture, stage, watch } from "./show.js";
import { fetchWhole } from "./whole.js";

/** Shows the dataset at `url`, then loads all of it. `job` is explained in run.js. */
window.run = async (job) => {
  const [version, name] = job.format === "potree1" ? ["v1", "cloud.js"] : ["v2", "metadata.json"];
  const potree = new Potree(version);
  const cloud = await potree.loadPointCloud(name, (path) => `${job.url}/${path}`, job.whole ? fetchWhole : undefined);
  const shown = job.draw && (await show(potree, cloud, job));
  return { ...shown, ...(await loadAll(cloud, job)) };
};

async function show(potree, cloud, job) {
  const view = stage(job.box);
  const { material } = cloud;
  material.pointSizeType = PointSizeType.FIXED;
  material.size = 3;
  if (job.colourBy) material.pointColorType = PointColorType[job.colourBy];
  if (job.intensity) material.intensityRange = job.intensity;
  const watched = await watch(potree, cloud, view, job.points);
  return { ...watched, picture: picture(view, job.balls) };
}
