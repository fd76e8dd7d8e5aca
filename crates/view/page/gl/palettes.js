// Gradients and the colours of classes.

const STOPS = {
  spectral: [[94, 79, 162], [50, 136, 189], [102, 194, 165], [171, 221, 164], [230, 245, 152], [254, 224, 139], [253, 174, 97], [244, 109, 67], [213, 62, 79], [158, 1, 66]],
  viridis: [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]],
  grey: [[20, 20, 20], [255, 255, 255]],
  terrain: [[51, 102, 153], [102, 178, 102], [230, 220, 130], [160, 110, 70], [255, 255, 255]],
};

export const GRADIENTS = Object.keys(STOPS);

/** 256 colours, RGBA. */
export function gradient(name) {
  const stops = STOPS[name] ?? STOPS.spectral;
  const rgba = new Uint8Array(1024);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (stops.length - 1);
    const from = Math.min(Math.floor(at), stops.length - 2);
    for (let c = 0; c < 3; c++) rgba[4 * i + c] = stops[from][c] + (stops[from + 1][c] - stops[from][c]) * (at - from) + 0.5;
    rgba[4 * i + 3] = 255;
  }
  return rgba;
}

export function css(name) {
  const rgba = gradient(name);
  const stops = [0, 64, 128, 192, 255].map((i) => `rgb(${rgba.slice(4 * i, 4 * i + 3).join(",")})`);
  return `linear-gradient(90deg, ${stops.join(", ")})`;
}

/** Titles and colours of the classes of LAS 1.4. */
export const CLASSES = [
  ["Never classified", 160, 160, 160], ["Unclassified", 200, 200, 200], ["Ground", 161, 112, 66], ["Low vegetation", 126, 190, 88],
  ["Medium vegetation", 74, 158, 60], ["High vegetation", 30, 110, 40], ["Building", 230, 120, 60], ["Low point", 240, 60, 200],
  ["Model key point", 250, 210, 60], ["Water", 60, 130, 220], ["Rail", 120, 90, 160], ["Road surface", 110, 110, 118],
  ["Overlap", 240, 240, 120], ["Wire, guard", 250, 240, 80], ["Wire, conductor", 255, 200, 0], ["Transmission tower", 200, 60, 60],
  ["Wire connector", 255, 140, 0], ["Bridge deck", 150, 140, 130], ["High noise", 255, 0, 80],
];

export const classTitle = (number) => CLASSES[number]?.[0] ?? `Class ${number}`;

export function classColour(number) {
  if (CLASSES[number]) return CLASSES[number].slice(1);
  const turn = (k) => Math.round(127 + 100 * Math.sin(number * 2.399963 + k));
  return [turn(0), turn(2.1), turn(4.2)];
}

/** 256 colours, RGBA; those of `hidden` have alpha 0. */
export function classTable(hidden) {
  const rgba = new Uint8Array(1024);
  for (let i = 0; i < 256; i++) rgba.set([...classColour(i), hidden.has(i) ? 0 : 255], 4 * i);
  return rgba;
}
