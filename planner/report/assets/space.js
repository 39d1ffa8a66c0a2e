// The scene in space: triangles, points and thick lines by WebGL 2, a camera that turns about a
// point. Lengths in metres, z up; matrices are column by column.

const Mat = {
  identity: () => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
  times(a, b) {
    const out = new Array(16);
    for (let c = 0; c < 4; c++) {
      for (let r = 0; r < 4; r++) {
        out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2]
          + a[12 + r] * b[4 * c + 3];
      }
    }
    return out;
  },
  /** A turn about a unit axis. [rad] */
  turn([x, y, z], angle) {
    const c = Math.cos(angle), s = Math.sin(angle), d = 1 - c;
    return [x * x * d + c, x * y * d + z * s, x * z * d - y * s, 0,
      x * y * d - z * s, y * y * d + c, y * z * d + x * s, 0,
      x * z * d + y * s, y * z * d - x * s, z * z * d + c, 0, 0, 0, 0, 1];
  },
  shift: ([x, y, z]) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1],
  apply: (m, [x, y, z]) => [m[0] * x + m[4] * y + m[8] * z + m[12],
    m[1] * x + m[5] * y + m[9] * z + m[13], m[2] * x + m[6] * y + m[10] * z + m[14]],
  perspective(fov, aspect, near, far) {
    const f = 1 / Math.tan(fov / 2);
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1,
      0, 0, 2 * far * near / (near - far), 0];
  },
};
const Vec = {
  sub: (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]],
  add: (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]],
  scale: (a, s) => [a[0] * s, a[1] * s, a[2] * s],
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  unit(a) { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; },
};

/** Where two faces meet at less than this, the edge between them is shaded round. */
const CREASE = Math.cos(0.7);
const FOV = 0.7;

const HEAD = '#version 300 es\nprecision highp float;\n';
const SHADERS = {
  mesh: [`in vec3 at; in vec3 normal; uniform mat4 model, view, lens; out vec3 n;
    void main() { n = mat3(view) * mat3(model) * normal;
      gl_Position = lens * view * model * vec4(at, 1.0); }`,
  `in vec3 n; uniform vec4 colour; out vec4 pixel;
    void main() { vec3 m = normalize(gl_FrontFacing ? n : -n);
      float light = 0.6 + 0.13 * m.y + 0.34 * max(0.0, dot(m, normalize(vec3(0.35, 0.55, 0.8))));
      pixel = vec4(colour.rgb * light, colour.a); }`],
  points: [`in vec3 at; uniform vec3 low, size; uniform mat4 view, lens; uniform float grain, height;
    void main() { gl_Position = lens * view * vec4(low + size * at, 1.0);
      gl_PointSize = clamp(grain * height / gl_Position.w, 1.5, 24.0); }`,
  `uniform vec4 colour; out vec4 pixel;
    void main() { if (length(gl_PointCoord - 0.5) > 0.5) discard; pixel = colour; }`],
  lines: [`in vec3 a, b; in vec2 ia, ib; uniform mat4 view, lens; uniform vec2 screen;
    uniform float wide, lift; out float value; out float when;
    void main() { vec4 p = lens * view * vec4(a, 1.0), q = lens * view * vec4(b, 1.0);
      if (p.w < 0.02 || q.w < 0.02) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
      vec2 along = (q.xy / q.w - p.xy / p.w) * screen;
      along = length(along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
      bool end = gl_VertexID > 1; float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
      vec4 e = end ? q : p;
      vec2 off = (vec2(-along.y, along.x) * side + along * (end ? 0.5 : -0.5)) * wide / screen;
      gl_Position = vec4(e.xy + off * e.w, e.z - lift, e.w);
      value = end ? ib.x : ia.x; when = end ? ib.y : ia.y; }`,
  `in float value, when; uniform vec4 colour; uniform float ramp, now; out vec4 pixel;
    vec3 tint(float t) { // dark blue, teal, yellow: even in lightness, also for the colour-blind
      vec3 c[5] = vec3[5](vec3(.27, .0, .36), vec3(.23, .32, .55), vec3(.13, .57, .55),
        vec3(.37, .79, .38), vec3(.99, .86, .14));
      float x = clamp(t, 0.0, 1.0) * 4.0; int i = int(min(x, 3.0));
      return mix(c[i], c[i + 1], x - float(i)); }
    void main() { vec3 rgb = ramp > 0.5 && value >= 0.0 ? tint(value) : colour.rgb;
      pixel = vec4(rgb, when > now ? colour.a * 0.4 : colour.a); }`],
};

class Space {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext('webgl2', { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error('this browser offers no WebGL 2');
    this.gl = gl;
    this.programs = {};
    for (const [name, [vertex, fragment]] of Object.entries(SHADERS)) {
      this.programs[name] = this.program(vertex, fragment);
    }
    this.things = [];
    this.camera = { target: [0, 0, 0.5], distance: 3, turn: -2.4, tilt: 0.45 };
    this.mark = null;
    this.stale = true;
    this.steer();
    new ResizeObserver(() => this.touch()).observe(canvas);
  }

  touch() { this.stale = true; this.onstale?.(); }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, HEAD + text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) {
        throw new Error(gl.getShaderInfoLog(shader));
      }
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      throw new Error(gl.getProgramInfoLog(program));
    }
    const places = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const { name } = gl.getActiveUniform(program, i);
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places, at: name => gl.getAttribLocation(program, name) };
  }

  /** A vertex array: each attribute is [name, size, type, normalised, stride, offset, divisor]. */
  array(kind, data, attributes) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    for (const [name, size, type, normalised, stride, offset, divisor] of attributes) {
      const at = this.programs[kind].at(name);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, type, normalised, stride, offset);
      gl.vertexAttribDivisor(at, divisor);
    }
    gl.bindVertexArray(null);
    return { array, buffer };
  }

  /** Triangles; `colour` gives [r, g, b, a] at drawing, `models` the matrices that it stands at. */
  mesh(vertices, triangles, colour, models) {
    const data = shaded(vertices, triangles), f = this.gl.FLOAT;
    const { array } = this.array('mesh', data,
      [['at', 3, f, false, 24, 0, 0], ['normal', 3, f, false, 24, 12, 0]]);
    return this.add({ kind: 'mesh', array, count: data.length / 6, colour, models });
  }

  /** Points as shares of a box, in 16 bits. */
  points(shares, low, size, colour) {
    const { array } = this.array('points', shares,
      [['at', 3, this.gl.UNSIGNED_SHORT, true, 6, 0, 0]]);
    return this.add({ kind: 'points', array, count: shares.length / 3, low, size, colour });
  }

  /** Thick lines through points of x, y, z, value 0…1 (or below 0: no value), time. */
  lines(data, colour, style) {
    const thing = this.add({ kind: 'lines', colour, ...style });
    this.reline(thing, data);
    return thing;
  }

  reline(thing, data) {
    const gl = this.gl, f = gl.FLOAT;
    if (thing.buffer) { gl.deleteBuffer(thing.buffer); gl.deleteVertexArray(thing.array); }
    Object.assign(thing, this.array('lines', data, [['a', 3, f, false, 40, 0, 1],
      ['ia', 2, f, false, 40, 12, 1], ['b', 3, f, false, 40, 20, 1], ['ib', 2, f, false, 40, 32, 1]]));
    thing.count = data.length / 10;
  }

  add(thing) { thing.shown = true; this.things.push(thing); this.touch(); return thing; }

  view() {
    const { target, distance, turn, tilt } = this.camera;
    const back = [Math.cos(tilt) * Math.cos(turn), Math.cos(tilt) * Math.sin(turn), Math.sin(tilt)];
    const eye = Vec.add(target, Vec.scale(back, distance));
    const right = [-Math.sin(turn), Math.cos(turn), 0], up = Vec.cross(back, right);
    return { back, right, up, matrix: [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0,
      right[2], up[2], back[2], 0, -Vec.dot(right, eye), -Vec.dot(up, eye), -Vec.dot(back, eye), 1] };
  }

  draw(now) {
    const gl = this.gl, canvas = this.canvas, ratio = Math.min(window.devicePixelRatio || 1, 2);
    const w = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const h = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    gl.viewport(0, 0, w, h);
    gl.clearColor(...colourOf('--sky').slice(0, 3), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
    const view = this.view(), far = this.camera.distance;
    const lens = Mat.perspective(FOV, w / h, 0.02 * far, far + 40);
    const height = h / (2 * Math.tan(FOV / 2));
    const order = [...this.things.filter(t => t.shown)].sort((a, b) => rank(a) - rank(b));
    if (this.mark) order.push(this.ring(view));
    for (const thing of order) {
      const { program, places } = this.programs[thing.kind], colour = thing.colour();
      const clear = colour[3] < 1 && thing.kind === 'mesh';
      gl.depthMask(!clear);
      gl.useProgram(program);
      gl.uniformMatrix4fv(places.view, false, view.matrix);
      gl.uniformMatrix4fv(places.lens, false, lens);
      gl.uniform4fv(places.colour, colour);
      gl.bindVertexArray(thing.array);
      if (thing.kind === 'mesh') {
        // What was measured shows only where it is not where the plan is.
        if (thing.ghost) { gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(2, 8); }
        for (const model of thing.models()) {
          gl.uniformMatrix4fv(places.model, false, model);
          gl.drawArrays(gl.TRIANGLES, 0, thing.count);
        }
        gl.disable(gl.POLYGON_OFFSET_FILL);
      } else if (thing.kind === 'points') {
        gl.uniform3fv(places.low, thing.low);
        gl.uniform3fv(places.size, thing.size);
        gl.uniform1f(places.grain, thing.grain ?? 0.006);
        gl.uniform1f(places.height, height);
        gl.drawArrays(gl.POINTS, 0, thing.count);
      } else {
        gl.uniform2f(places.screen, w, h);
        gl.uniform1f(places.wide, thing.wide * ratio);
        gl.uniform1f(places.lift, thing.lift ?? 0);
        gl.uniform1f(places.ramp, thing.ramp ? 1 : 0);
        gl.uniform1f(places.now, thing.passes ? now : Infinity);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, thing.count);
      }
    }
    gl.depthMask(true);
    gl.bindVertexArray(null);
    this.stale = false;
  }

  /** Draws and waits until it is drawn. */
  finish(now) {
    this.draw(now);
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  /** A circle that faces the camera about the place that was flown to. */
  ring({ right, up }) {
    const { at, radius } = this.mark, data = [];
    const point = k => {
      const a = k * Math.PI / 24;
      return [...Vec.add(at, Vec.add(Vec.scale(right, radius * Math.cos(a)),
        Vec.scale(up, radius * Math.sin(a)))), -1, 0];
    };
    for (let k = 0; k < 48; k++) data.push(...point(k), ...point(k + 1));
    this.marker ??= { kind: 'lines', wide: 3, lift: 1, colour: () => colourOf('--left') };
    this.reline(this.marker, new Float32Array(data));
    return this.marker;
  }

  /** Looks at a ball; slowly, unless the user wants no motion. */
  fly(target, radius, view = {}, at_once = false) {
    const from = { ...this.camera };
    const wide = Math.min(1, this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight));
    const to = { ...from, ...view, target, distance: radius / Math.sin(FOV / 2) / wide };
    if (at_once || matchMedia('(prefers-reduced-motion: reduce)').matches) {
      this.camera = to;
      this.touch();
      return;
    }
    const start = performance.now(), flight = this.flight = {};
    const step = () => {
      if (this.flight !== flight) return;
      const share = Math.min(1, (performance.now() - start) / 600);
      const s = share * share * (3 - 2 * share), mix = (a, b) => a + (b - a) * s;
      this.camera = { target: [0, 1, 2].map(i => mix(from.target[i], to.target[i])),
        distance: from.distance * Math.pow(to.distance / from.distance, s),
        turn: mix(from.turn, to.turn), tilt: mix(from.tilt, to.tilt) };
      this.touch();
      if (share < 1) requestAnimationFrame(step);
    };
    step();
  }

  orbit(turn, tilt) {
    this.flight = null;
    this.camera.turn += turn;
    this.camera.tilt = Math.max(-1.5, Math.min(1.55, this.camera.tilt + tilt));
    this.touch();
  }

  pan(x, y) {
    this.flight = null;
    const { right, up } = this.view();
    const step = 2 * Math.tan(FOV / 2) * this.camera.distance / this.canvas.clientHeight;
    this.camera.target = Vec.add(this.camera.target,
      Vec.add(Vec.scale(right, -x * step), Vec.scale(up, y * step)));
    this.touch();
  }

  zoom(factor) {
    this.flight = null;
    this.camera.distance = Math.max(0.05, Math.min(80, this.camera.distance * factor));
    this.touch();
  }

  /** Drag turns, right button or two fingers shift, wheel or pinch zooms. */
  steer() {
    const canvas = this.canvas, held = new Map();
    const spread = () => {
      const [a, b] = [...held.values()];
      return { gap: Math.hypot(a[0] - b[0], a[1] - b[1]), x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2 };
    };
    canvas.addEventListener('contextmenu', e => e.preventDefault());
    canvas.addEventListener('pointerdown', e => {
      canvas.setPointerCapture(e.pointerId);
      held.set(e.pointerId, [e.clientX, e.clientY]);
    });
    for (const end of ['pointerup', 'pointercancel']) {
      canvas.addEventListener(end, e => held.delete(e.pointerId));
    }
    canvas.addEventListener('pointermove', e => {
      const old = held.get(e.pointerId);
      if (!old) return;
      const before = held.size === 2 ? spread() : null;
      held.set(e.pointerId, [e.clientX, e.clientY]);
      if (before) {
        const after = spread();
        this.zoom(before.gap / Math.max(1, after.gap));
        this.pan(after.x - before.x, after.y - before.y);
      } else if (e.buttons & 2 || e.shiftKey) {
        this.pan(e.clientX - old[0], e.clientY - old[1]);
      } else {
        this.orbit((old[0] - e.clientX) * 0.008, (e.clientY - old[1]) * 0.008);
      }
    });
    canvas.addEventListener('wheel', e => {
      e.preventDefault();
      this.zoom(Math.exp(Math.max(-1, Math.min(1, e.deltaY * 0.0015))));
    }, { passive: false });
  }
}

/** Solid things first, then lines, then what light passes through. */
function rank(thing) {
  return thing.kind !== 'mesh' ? 1 : thing.colour()[3] < 1 ? 2 : 0;
}

/** Corners of triangles with normals, averaged over faces that meet at a blunt angle. */
function shaded(vertices, triangles) {
  const corner = i => [vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]];
  const faces = [], around = new Map();
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map(k => corner(triangles[t + k]));
    const across = Vec.cross(Vec.sub(b, a), Vec.sub(c, a));
    const face = { corners: [a, b, c], across, normal: Vec.unit(across) };
    faces.push(face);
    for (const p of face.corners) {
      const key = p.map(x => Math.round(x * 1e5)).join();
      around.set(key, [...(around.get(key) ?? []), face]);
    }
  }
  const data = new Float32Array(18 * faces.length);
  let at = 0;
  for (const { corners, normal } of faces) {
    for (const p of corners) {
      const near = around.get(p.map(x => Math.round(x * 1e5)).join());
      const sum = near.filter(f => Vec.dot(f.normal, normal) > CREASE)
        .reduce((s, f) => Vec.add(s, f.across), [0, 0, 0]);
      data.set(p, at);
      data.set(Vec.unit(sum), at + 3);
      at += 6;
    }
  }
  return data;
}

const colours = new Map();
/** A colour of the style sheet as [r, g, b, a], 0…1. */
function colourOf(name, alpha = 1) {
  if (!colours.has(name)) {
    const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    const n = parseInt(text.slice(1, 7), 16);
    colours.set(name, [(n >> 16 & 255) / 255, (n >> 8 & 255) / 255, (n & 255) / 255]);
  }
  return [...colours.get(name), alpha];
}
