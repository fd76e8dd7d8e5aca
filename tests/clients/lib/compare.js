// Holds what a client found against what it must find. Each difference is one line.

const BALL_PIXELS = 2; // points are squares of 3 pixels: half of one, and half a pixel of the projection, at most
const COLOUR = 3; // of 255: rounding in the client, in its shader and in the picture

/** All differences between `found`, the result of a page, and `wanted`, `{ expected, validated, cube, ... }`. */
export function differences(found, wanted) {
  return [...points(found, wanted), ...tree(found, wanted), ...boxes(found, wanted), ...drawn(found, wanted), ...found.complaints];
}

function* points({ sums, declared }, { expected }) {
  if (sums.count !== expected.sums.count) yield `points: ${sums.count}, the scan has ${expected.sums.count}`;
  if (declared !== undefined && declared !== expected.sums.count) yield `points of the header: ${declared}, the scan has ${expected.sums.count}`;
  for (const [name, column] of Object.entries(expected.sums.columns)) {
    const other = sums.columns[name];
    const text = ({ least, greatest, hash }) => `${least} to ${greatest}, hash ${hash}`;
    if (text(other) !== text(column)) yield `${name}: ${text(other)}; of the scan ${text(column)}`;
  }
  if (sums.points !== expected.sums.points) yield "points are put together of values that do not belong together";
}

function* tree({ nodes, depth, chunks }, { validated, levels, dataset }) {
  // not a fault of the dataset, but then it is none of those that it stands for
  if (chunks < dataset.chunks) yield `${chunks} chunks of the hierarchy below one another, ${dataset.chunks} are wanted`;

  if (nodes !== validated.nodes) yield `nodes: ${nodes}, validate counts ${validated.nodes}`;
  if (depth !== levels - 1) yield `deepest level: ${depth}, info has levels 0 to ${levels - 1}`;
}

function* boxes({ cube, box, ranges }, { expected, dataset, client }) {
  const near = (a, b) => a.every((corner, i) => corner.every((value, axis) => Math.abs(value - b[i][axis]) <= 8 * Number.EPSILON * Math.abs(value)));
  if (!expected.box[0].every((value, axis) => value >= cube[0][axis] && expected.box[1][axis] <= cube[1][axis])) yield `cube ${cube} does not hold ${expected.box}`;
  // Potree and potree-core take the cube of Potree 2.0 for the box of the points
  const taken = dataset.format === "potree2" && client !== "three-loader" ? cube : expected.box;
  if (!near(box, taken)) yield `box: ${box}, not ${taken}`;
  for (const [name, range] of Object.entries(expected.ranges)) {
    const other = ranges[name];
    if (other === undefined) continue;
    // clients widen a range of GPS times that is empty, to be able to divide by it
    const greatest = name === "gps-time" && range[0] === range[1] && dataset.format === "potree2" ? range[1] + 1 : range[1];
    if (other[0] !== range[0] || other[1] !== greatest) yield `range of ${name}: ${other}, of the scan ${range}`;
  }
  if (dataset.format === "potree2" && !("intensity" in ranges)) yield "no range of intensity";
}

function* drawn({ shown, picture }, { expected, balls, dataset, client }) {
  if (!picture) return;
  if (shown !== expected.sums.count) yield `${shown} points are in the scene, of ${expected.sums.count}`;
  if (picture.drawn < (shown > 1 ? 0.05 : 1e-5)) yield `the picture is empty: ${100 * picture.drawn} % drawn`;
  // potree-core draws Potree 2.0 without colour black, whatever it is to be coloured by: held on to, so that a change is seen
  const black = client === "potree-core" && dataset.format === "potree2" && !expected.names.includes("r");
  if (picture.brightest > 0 === black) yield black ? "no longer black: say so in README.md" : "the cloud is black";
  for (const [k, ball] of balls.entries()) {
    const [there, here] = [picture.balls[k], picture.expected[k]];
    const off = Math.hypot(there.x - here.x, there.y - here.y);
    if (!(off <= BALL_PIXELS)) yield `the ${ball.name} ball is at ${there.x}, ${there.y} of the picture, not at ${here.x}, ${here.y}`;
    const colour = Math.max(...there.colour.map((value, c) => Math.abs(value - ball.colour[c])));
    if (!(colour <= COLOUR)) yield `the ${ball.name} ball is ${there.colour}, not ${ball.colour}`;
  }
}
