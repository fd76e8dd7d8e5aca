// What a set of points is, whatever their order: of each column the least and greatest value and a hash, and one of whole
// points. Runs in node for the source and in the browser for the client, on the same numbers.

const float = new Float64Array(1);
const words = new Uint32Array(float.buffer);

/** Two independent 32-bit lanes over the bits of a double. -0 counts as 0. */
function mix(lanes, value) {
  float[0] = value + 0;
  for (const word of words) {
    lanes[0] = Math.imul(lanes[0] ^ word, 0x9e3779b1);
    lanes[0] ^= lanes[0] >>> 15;
    lanes[1] = Math.imul(lanes[1] + word, 0x85ebca6b);
    lanes[1] ^= lanes[1] >>> 13;
  }
}

/** The sum of hashes modulo 2^32: that of a multiset, as a sum has no order and counts what is there twice. */
class Hash {
  total = [0, 0];
  add(lanes) {
    for (let lane = 0; lane < 2; lane++) {
      const last = Math.imul(lanes[lane] ^ (lanes[lane] >>> 16), 0xc2b2ae35);
      this.total[lane] = (this.total[lane] + (last ^ (last >>> 14))) >>> 0;
    }
  }
  text() {
    return this.total.map((word) => word.toString(16).padStart(8, "0")).join("");
  }
}

/** Counts, ranges and hashes of points that arrive in pieces with the same columns. */
export class Sums {
  constructor(names) {
    this.names = names;
    this.count = 0;
    this.points = new Hash();
    this.columns = names.map(() => ({ least: Infinity, greatest: -Infinity, hash: new Hash() }));
  }

  /** `columns[k]` holds the values of the column `names[k]`, one for each point. */
  add(count, columns) {
    const point = new Int32Array(2);
    const single = new Int32Array(2);
    for (let i = 0; i < count; i++) {
      point[0] = 1;
      point[1] = 2;
      for (let k = 0; k < columns.length; k++) {
        const value = columns[k][i];
        const column = this.columns[k];
        if (value < column.least) column.least = value;
        if (value > column.greatest) column.greatest = value;
        single[0] = 1;
        single[1] = 2;
        mix(single, value);
        column.hash.add(single);
        mix(point, value);
      }
      this.points.add(point);
    }
    this.count += count;
  }

  /** Plain data, to be compared and sent. */
  result() {
    const columns = this.columns.map(({ least, greatest, hash }, k) => [this.names[k], { least, greatest, hash: hash.text() }]);
    return { count: this.count, points: this.points.text(), columns: Object.fromEntries(columns) };
  }
}
