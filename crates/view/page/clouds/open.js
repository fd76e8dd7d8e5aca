// A cloud of whatever kind.

import { BatchesCloud } from "pm/clouds/batches.js";
import { BintreeCloud } from "pm/clouds/bintree.js";
import { OctreeCloud } from "pm/clouds/octree.js";

export async function openCloud(gl, source) {
  const scene = await source.scene();
  switch (scene.kind) {
    case "octree":
      return new OctreeCloud(gl, source, scene);
    case "bintree":
      return new BintreeCloud(gl, source, scene, await source.boxes());
    case "batches":
      return new BatchesCloud(gl, source, scene, await source.boxes());
    default:
      throw new Error(`${scene.name ?? "dataset"}: this page does not know the kind ${scene.kind}`);
  }
}
