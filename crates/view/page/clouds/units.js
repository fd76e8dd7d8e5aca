// What all kinds of clouds do with the units that they load.

import { pointBlock } from "pm/clouds/block.js";

/** The points of a unit have the values that the colouring needs. */
export const isCurrent = ({ block }, attribute) => attribute === undefined || block?.attribute === attribute;

/** Points that came, with the attribute that was requested, take the place of those that were there. */
export function put(unit, block, requested, attribute) {
  unit.block?.free();
  unit.block = block;
  block.attribute = requested;
  if (isCurrent(unit, attribute)) return;
  // another colouring was chosen meanwhile
  block.dropExtra();
  unit.state = "new";
}

/** `put`, for kinds whose points have classes of their own. */
export function putPoints(cloud, unit, points, requested) {
  put(unit, pointBlock(cloud.gl, points), requested, cloud.attribute);
  unit.block.classes.forEach((number) => cloud.classes.add(number));
}

/** Another attribute is wanted: points have to come again, and stay without one until then. */
export function renew(units, attribute) {
  for (const unit of units) {
    const isRight = unit.block !== undefined && isCurrent(unit, attribute);
    if (unit.block && !isRight) unit.block.dropExtra();
    // what could not be read may be readable without the former attribute
    if (unit.state === "failed" || unit.state === "ready") unit.state = isRight || unit.size === 0 ? "ready" : "new";
  }
}

/** The points go. A unit whose request is under way keeps waiting for it. */
export function drop(unit) {
  unit.block?.free();
  unit.block = undefined;
  if (unit.state !== "loading") unit.state = "new";
}

/** How many points each cloud may draw: what small ones do not need is for the others. */
export function shares(clouds, budget) {
  const points = ({ scene }) => scene.points ?? Infinity;
  let left = budget;
  const share = (cloud, i) => {
    const most = Math.floor(left / (clouds.length - i));
    left -= Math.min(most, points(cloud));
    return [cloud, most];
  };
  const bySize = [...clouds].sort((a, b) => (points(a) === points(b) ? 0 : points(a) - points(b)));
  return new Map(bySize.map(share));
}
