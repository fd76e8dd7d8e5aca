// A scene of three.js with one cloud of potree-core or three-loader, loaded and drawn as a user sees it.

import { PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { look, measure, project } from "./picture.js";

const PATIENCE = 5000; // milliseconds for the next node

/** A renderer on the canvas of the page, a camera that sees `box`, and a scene. */
export function stage(box) {
  const canvas = document.querySelector("canvas");
  const renderer = new WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
  renderer.setClearColor(0x4080a0);
  renderer.outputColorSpace = "srgb-linear"; // colours as they are in the dataset, not encoded once more
  const camera = new PerspectiveCamera(50, canvas.width / canvas.height);
  look(camera, box);
  return { canvas, renderer, camera, scene: new Scene() };
}

/** Draws what is in `scene` and measures it. */
export function picture({ canvas, renderer, camera, scene }, balls) {
  renderer.render(scene, camera);
  return { ...measure(canvas, balls), expected: project(camera, canvas, balls, Vector3) };
}

/** Lets the client choose, load and draw what the camera sees, until `points` are in the scene or nothing comes any more. */
async function watch(potree, cloud, stage, points) {
  stage.scene.add(cloud);
  potree.pointBudget = 10_000_000;
  cloud.minNodePixelSize = 0;
  let [frames, shown, progress] = [0, 0, performance.now()];
  while (shown < points && performance.now() - progress < PATIENCE) {
    await new Promise(requestAnimationFrame);
    potree.updatePointClouds([cloud], stage.camera, stage.renderer);
    const now = cloud.visibleNodes.reduce((sum, node) => sum + node.sceneNode.geometry.attributes.position.count, 0);
    if (now !== shown) progress = performance.now();
    shown = now;
    frames += 1;
  }
  return { frames, shown };
}

/** Stages, loads and draws a cloud; the last argument are the client's own tables of choices. What the client then sees, and its picture. */
export async function showCloud(potree, cloud, job, { PointColorType, PointSizeType }) {
  const view = stage(job.box);
  const { material } = cloud;
  material.pointSizeType = PointSizeType.FIXED;
  material.size = 3;
  if (job.colourBy) material.pointColorType = PointColorType[job.colourBy];
  if (job.intensity) material.intensityRange = job.intensity;
  const watched = await watch(potree, cloud, view, job.points);
  return { ...watched, picture: picture(view, job.balls) };
}
