// WebGL 2: programs with their uniforms, buffers, the target that points are drawn into.

/** The context, or an error that says what is missing. */
export function open(canvas) {
  const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" });
  if (!gl) {
    throw new Error("This browser has no WebGL 2, which the picture needs: use a current browser, or switch on hardware acceleration.");
  }
  return gl;
}

/** A linked program; its uniforms by name. `attributes` have the locations of their order. */
export function program(gl, vertex, fragment, attributes) {
  const shader = (type, source) => {
    const compiled = gl.createShader(type);
    gl.shaderSource(compiled, `#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp usampler2D;\n${source}`);
    gl.compileShader(compiled);
    if (!gl.getShaderParameter(compiled, gl.COMPILE_STATUS) && !gl.isContextLost()) {
      throw new Error(`shader: ${gl.getShaderInfoLog(compiled)}`);
    }
    return compiled;
  };
  const linked = gl.createProgram();
  gl.attachShader(linked, shader(gl.VERTEX_SHADER, vertex));
  gl.attachShader(linked, shader(gl.FRAGMENT_SHADER, fragment));
  attributes.forEach((name, at) => gl.bindAttribLocation(linked, at, name));
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Error(`program: ${gl.getProgramInfoLog(linked)}`);
  }
  const at = {};
  const count = gl.getProgramParameter(linked, gl.ACTIVE_UNIFORMS) ?? 0;
  for (let i = 0; i < count; i++) {
    const { name } = gl.getActiveUniform(linked, i);
    at[name] = gl.getUniformLocation(linked, name);
  }
  return { program: linked, at };
}

export function buffer(gl, data) {
  const made = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, made);
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  return made;
}

/** A table of 256 colours. */
export function table(gl, rgba) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
  for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
  return texture;
}

/** Colours (or whole numbers, for `pick`) and depth, as large as the picture. */
export class Target {
  constructor(gl, isPick) {
    Object.assign(this, { gl, isPick, width: 0, height: 0, frame: gl.createFramebuffer() });
  }

  resize(width, height) {
    if (this.width === width && this.height === height) return;
    const { gl } = this;
    gl.deleteTexture(this.colour);
    gl.deleteTexture(this.depth);
    const texture = (inside, format, type) => {
      const made = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, made);
      gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, type, null);
      for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
      return made;
    };
    this.colour = this.isPick
      ? texture(gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT)
      : texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
    this.depth = texture(gl.DEPTH_COMPONENT32F, gl.DEPTH_COMPONENT, gl.FLOAT);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.colour, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.depth, 0);
    Object.assign(this, { width, height });
  }
}
