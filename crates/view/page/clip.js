// The clip box, as it is chosen, and as it is drawn.

/**
 * An end at the edge of everything, or beyond it, cuts nothing: coordinates are rounded on the way to the picture, and the
 * outermost points must not fall victim to that.
 */
export function drawn(clip, box) {
  const extent = box.max.map((high, a) => high - box.min[a] || 1);
  return {
    min: clip.min.map((v, a) => (v <= box.min[a] ? box.min[a] - extent[a] : v)),
    max: clip.max.map((v, a) => (v >= box.max[a] ? box.max[a] + extent[a] : v)),
  };
}

export const copy = ({ min, max }) => ({ min: [...min], max: [...max] });
