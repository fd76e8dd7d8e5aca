// The view as the part of the address behind "#": a link that restores it.

const NUMBERS = ["eye", "target"];

export function write(app) {
  const { camera, renderer, budget } = app;
  const { colour, size, edl, shape, boxes, isAdaptive, gradient } = renderer.settings;
  const fields = { eye: camera.eye.map(short).join(","), target: camera.target.map(short).join(","), fov: camera.fov, colour, size, edl, shape, budget, gradient };
  if (boxes) fields.boxes = 1;
  if (!isAdaptive) fields.adaptive = 0;
  return `#${new URLSearchParams(fields).toString().replaceAll("%2C", ",")}`;
}

// a tenth of a millimetre at ten thousand kilometres
const short = (x) => String(Number(x.toPrecision(12)));

/** What a link says, as far as it makes sense. */
export function read(hash) {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  const out = {};
  for (const name of NUMBERS) {
    const numbers = (fields.get(name) ?? "").split(",").map(Number);
    if (numbers.length === 3 && numbers.every(Number.isFinite) && fields.get(name)) out[name] = numbers;
  }
  const number = (name, low, high) => {
    const value = Number(fields.get(name) ?? NaN);
    if (value >= low && value <= high) out[name] = value;
  };
  number("fov", 10, 120);
  number("size", 0.5, 10);
  number("edl", 0, 2);
  number("budget", 1e4, 2e7);
  for (const name of ["colour", "shape", "gradient"]) if (fields.get(name)) out[name] = fields.get(name);
  if (fields.get("boxes") === "1") out.boxes = true;
  if (fields.get("adaptive") === "0") out.isAdaptive = false;
  return out;
}
