// The positions of a client are single-precision numbers relative to something. Here they become the integers of the scan
// again, and whatever cannot be explained by rounding is an error.

/** Distance from a double to the next. */
function ulp(value) {
  const exponent = Math.floor(Math.log2(Math.max(Math.abs(value), Number.MIN_VALUE)));
  return 2 ** (exponent - 52);
}

/**
 * Turns coordinates of points into integers on the lattice `{ scale, offset }` of the scan, axis by axis.
 *
 * A client computes `X · scale + offset − corner of the node` in doubles, which rounds three times, with a corner that was
 * rounded with each level above; then it rounds to single precision. So a coordinate is off by at most
 * `side · 2⁻²⁴ + (4 + level) · ulp(largest coordinate)`, and by what the format itself rounds (`slack`, world units).
 */
export class Lattice {
  constructor({ scale, offset }, slack = 0) {
    Object.assign(this, { scale, offset, slack, worst: 0 });
  }

  /**
   * @param values  coordinates of all points, x y z x y z …, relative to `corner`
   * @param corner  world coordinates of the corner
   * @param node    `{ name, level, side }`: side is the greatest |value| there may be
   * @returns three arrays of integers
   */
  integers(values, corner, { name, level, side }) {
    return [0, 1, 2].map((axis) => {
      const { scale, offset } = this;
      const far = Math.max(Math.abs(corner[axis]), Math.abs(corner[axis] + side), Math.abs(offset[axis]));
      const bound = side * 2 ** -24 + (4 + level) * ulp(far) + this.slack;
      if (bound >= scale[axis] / 2) throw new Error(`${name}: single precision (${bound}) does not resolve the step ${scale[axis]}`);
      const origin = corner[axis] - offset[axis];
      const result = new Float64Array(values.length / 3);
      for (let i = 0; i < result.length; i++) {
        const value = values[3 * i + axis];
        if (!(value >= -bound && value <= side + bound)) throw new Error(`${name}: point ${i} is outside of its node: ${value} of ${side}`);
        const steps = (value + origin) / scale[axis];
        result[i] = Math.round(steps);
        const off = Math.abs(steps - result[i]) * scale[axis];
        if (off > bound) throw new Error(`${name}: point ${i} is ${off} off the lattice on axis ${axis}, more than rounding (${bound})`);
        this.worst = Math.max(this.worst, off / bound);
      }
      return result;
    });
  }
}
