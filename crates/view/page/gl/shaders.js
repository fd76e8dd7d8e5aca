// What the graphics card does. Places are whole numbers of steps; the eye is subtracted from them as a whole number, so
// that a point near the eye is exact however large the cloud is.

/** What all kinds of points share: from a place relative to the eye to pixel, size and colour. */
const SHARED = `
uniform mat4 uMatrix;
uniform vec3 uBack;           // from the target to the eye
uniform float uFocal;         // pixels of one unit at the distance 1
uniform vec2 uSizes;          // least and largest size in pixels
uniform float uSize;          // pixels if uIsWorld is 0, else world units
uniform int uIsWorld;
uniform vec3 uClipMin;        // relative to the eye
uniform vec3 uClipMax;
uniform int uColour;          // 0 own colours, 1 gradient of uRange, 2 classes, 3 level, 4 one colour
uniform vec2 uRange;          // value at the start of the gradient, 1 / (end - start)
uniform int uValue;           // the value of the gradient: 0 intensity, 1 height, 2 another attribute
uniform float uEyeHeight;
uniform vec3 uOne;
uniform sampler2D uGradient;
uniform sampler2D uClasses;   // alpha 0: hidden
uniform int uFilter;          // 1: classes are hidden by uClasses
uniform uint uUnit;
flat out vec3 vColour;
flat out uvec2 vId;
flat out float vRadius;       // world units

vec3 ofLevel(float level) {
  float h = fract(level * 0.381966) * 6.0;
  return clamp(vec3(abs(h - 3.0) - 1.0, 2.0 - abs(h - 2.0), 2.0 - abs(h - 4.0)), 0.15, 0.95);
}

void hide() {
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  gl_PointSize = 0.0;
}

void show(vec3 p, vec3 colour, float intensity, float group, float extra, float level, float size) {
  vec4 row = texture(uClasses, vec2((group + 0.5) / 256.0, 0.5));
  bool out_of_box = any(lessThan(p, uClipMin)) || any(greaterThan(p, uClipMax));
  vId = uvec2(uUnit, uint(gl_VertexID));
  vColour = colour;
  if (out_of_box || (uFilter == 1 && row.a == 0.0)) { hide(); return; }
  if (uColour == 1) {
    float value = uValue == 0 ? intensity : uValue == 1 ? p.z + uEyeHeight : extra;
    vColour = texture(uGradient, vec2(clamp((value - uRange.x) * uRange.y, 0.0, 1.0), 0.5)).rgb;
  } else if (uColour == 2) vColour = row.rgb;
  else if (uColour == 3) vColour = ofLevel(level);
  else if (uColour == 4) vColour = uOne;
  gl_Position = uMatrix * vec4(p, 1.0);
  float depth = max(-dot(p, uBack), 1e-30);
  gl_PointSize = clamp(uIsWorld == 1 ? size * uFocal / depth : size, uSizes.x, uSizes.y);
  vRadius = gl_PointSize * 0.5 * depth / uFocal;
}
`;

/** Nodes of octrees and leaves of binary trees. */
export const POINTS = `
in uvec4 aPlace;              // x, y, z in steps; intensity
in vec4 aColour;              // alpha: class / 255
in float aExtra;
uniform ivec3 uEye;           // whole steps
uniform vec3 uRest;           // world units beyond the whole steps
uniform vec3 uStep;
uniform int uMaterial;        // 0 plain; binary trees: 1 far, 2 near
uniform float uSwitch;        // distance of the two materials
uniform float uLevel;
uniform int uFirst;           // of adaptive sizes: the node in uNodes, or -1
uniform vec3 uCubeMin;        // of the node, relative to the eye
uniform float uSide;
uniform usampler2D uNodes;    // per visible node: first visible child << 8 | mask of visible children
uniform float uSpacing;       // of level 0
${SHARED}
void main() {
  vec3 p = vec3(ivec3(aPlace.xyz) - uEye) * uStep - uRest;
  float size = uSize;
  if (uFirst >= 0) {          // spacing of the deepest visible node at this place
    int node = uFirst;
    vec3 at = (p - uCubeMin) / uSide;
    float level = uLevel;
    for (int i = 0; i < 24; i++) {
      uint entry = texelFetch(uNodes, ivec2(node & 1023, node >> 10), 0).x;
      ivec3 high = ivec3(greaterThanEqual(at, vec3(0.5)));
      int child = high.x * 4 + high.y * 2 + high.z;
      uint below = (entry >> child) & 1u;
      if (below == 0u) break;
      uint before = entry & ((1u << child) - 1u);
      int skipped = 0;
      for (int bit = 0; bit < 8; bit++) skipped += int((before >> bit) & 1u);
      node = int(entry >> 8) + skipped;
      at = at * 2.0 - vec3(high);
      level += 1.0;
    }
    size = uSize * uSpacing * exp2(-level);
  }
  float away = length(p);
  bool is_other = (uMaterial == 1 && away <= uSwitch) || (uMaterial == 2 && away > uSwitch);
  show(p, aColour.rgb, float(aPlace.w), floor(aColour.a * 255.0 + 0.5), aExtra, uLevel, size);
  if (is_other) hide();
}
`;

/** Batches: planes of ten bits a coordinate, as the format page has them; bits by size, points by continuous level of detail. */
export const BATCHES = `
in uint aHi;
in uint aMid;
in uint aLo;
in uvec4 aColour;             // alpha: level of detail
in uint aIndex;               // within the batch
in float aExtra;
uniform int uBits;            // 10, 20 or 30
uniform vec3 uBoxMin;         // relative to the eye
uniform vec3 uBoxSides;
uniform uint uStart;          // storage index of the batch
uniform float uClod;          // 0: all points
uniform float uCell;
uniform float uLevel;
uniform float uExtraBase;     // what was subtracted from aExtra
${SHARED}
vec3 tens(uint word) {
  return vec3(uvec3(word, word >> 10, word >> 20) & 1023u);
}

float weight(uint h) {        // the same number on every machine, docs/formats/batches.md
  h ^= h >> 16; h *= 0x7feb352du; h ^= h >> 15; h *= 0x846ca68bu; h ^= h >> 16;
  return float(h >> 8) / 16777216.0;
}

void main() {
  // in parts: three times ten bits and a half are more than a single holds
  vec3 t = tens(aHi) / 1024.0;
  float cell = 1.0 / 1024.0;
  if (uBits > 10) { t += tens(aMid) / 1048576.0; cell /= 1024.0; }
  vec3 p = uBoxMin + t * uBoxSides;
  if (uBits > 20) { p += tens(aLo) * (uBoxSides / 1073741824.0); cell /= 1024.0; }
  p += uBoxSides * (0.5 * cell);
  float lod = float(aColour.a);
  show(p, vec3(aColour.rgb) / 255.0, 0.0, floor(aExtra + uExtraBase + 0.5), aExtra, uColour == 3 && uLevel >= 0.0 ? uLevel : lod, uSize);
  if (uClod > 0.0 && gl_PointSize > 0.0) {
    vec2 ndc = gl_Position.xy / gl_Position.w;
    float t = length(p) * uClod / (1000.0 * max(1.0 - 0.7 * length(ndc), 0.3));
    if (uCell / exp2(lod + weight(uStart + aIndex)) < t) hide();
  }
}
`;

/** Squares, circles or paraboloids. */
export const SHAPES = `
flat in vec3 vColour;
flat in uvec2 vId;
uniform int uShape;           // 0 square, 1 circle
out vec4 colour;
void main() {
  vec2 at = gl_PointCoord * 2.0 - 1.0;
  if (uShape == 1 && dot(at, at) > 1.0) discard;
  colour = vec4(vColour, 1.0);
}
`;

/** The same, and the depth bulges: neighbouring discs meet in a line, as cells of their centres. */
export const PARABOLOIDS = `
flat in vec3 vColour;
flat in uvec2 vId;
flat in float vRadius;
uniform vec2 uDepth;          // of the projection: depth in the picture = x + y / distance
out vec4 colour;
void main() {
  vec2 at = gl_PointCoord * 2.0 - 1.0;
  float away = dot(at, at);
  if (away > 1.0) discard;
  float z = uDepth.y / (gl_FragCoord.z * 2.0 - 1.0 - uDepth.x);
  z += away * vRadius;
  gl_FragDepth = 0.5 + 0.5 * (uDepth.x + uDepth.y / z);
  colour = vec4(vColour, 1.0);
}
`;

/** Numbers of unit and point, and the depth, for what is under the cursor. */
export const NUMBERS = `
flat in vec3 vColour;
flat in uvec2 vId;
uniform int uShape;
out uvec4 id;
void main() {
  vec2 at = gl_PointCoord * 2.0 - 1.0;
  if (uShape == 1 && dot(at, at) > 1.0) discard;
  id = uvec4(vId.x + 1u, vId.y, floatBitsToUint(1.0 / gl_FragCoord.w), 0u); // 0: nothing
}
`;

export const WHOLE = `
out vec2 vAt;
void main() {
  vAt = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
  gl_Position = vec4(vAt * 2.0 - 1.0, 0.0, 1.0);
}
`;

/** Eye-dome lighting: what lies behind its neighbours, in logarithms of depth, is darker. */
export const EYE_DOME = `
in vec2 vAt;
uniform sampler2D uPicture;
uniform sampler2D uDepths;
uniform vec2 uDepth;
uniform float uStrength;
uniform int uAway;            // pixels between neighbours
uniform vec3 uBackground;
out vec4 colour;
float logarithm(ivec2 pixel) {
  float depth = texelFetch(uDepths, pixel, 0).r;
  return log2(uDepth.y / (depth * 2.0 - 1.0 - uDepth.x));
}
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  float depth = texelFetch(uDepths, pixel, 0).r;
  gl_FragDepth = depth;
  if (depth == 1.0) { colour = vec4(uBackground, 1.0); return; }
  vec3 own = texelFetch(uPicture, pixel, 0).rgb;
  float shade = 1.0;
  if (uStrength > 0.0) {
    float here = logarithm(pixel);
    float sum = 0.0;
    for (int i = 0; i < 9; i++) {
      ivec2 beside = pixel + ivec2(i % 3 - 1, i / 3 - 1) * uAway;
      if (beside != clamp(beside, ivec2(0), textureSize(uDepths, 0) - 1)) continue;
      // a neighbour without a point darkens nothing
      if (texelFetch(uDepths, beside, 0).r < 1.0) sum += max(0.0, here - logarithm(beside));
    }
    shade = exp(-sum / 8.0 * 12.0 * uStrength);
  }
  colour = vec4(own * shade, 1.0);
}
`;

export const LINES = `
in vec3 aCorner;
uniform mat4 uMatrix;
uniform vec3 uBoxMin;
uniform vec3 uBoxSides;
void main() {
  gl_Position = uMatrix * vec4(uBoxMin + aCorner * uBoxSides, 1.0);
}
`;

export const LINE_COLOUR = `
uniform vec3 uOne;
out vec4 colour;
void main() { colour = vec4(uOne, 1.0); }
`;
