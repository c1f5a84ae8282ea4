/* The scene in three dimensions, by WebGL 2: bones as rigid bodies, muscles and fibres point by point.
   Parallel projection with z up, as in the figures; it draws when something has changed. */

const SURFACE_VERTEX = `#version 300 es
layout(location = 0) in vec3 point;
layout(location = 1) in vec3 normal;
layout(location = 2) in float value;
uniform mat4 place;
uniform mat3 turn;
uniform vec3 focus, scale;
out vec3 facing;
out float shade;
void main() {
  vec3 seen = turn * ((place * vec4(point, 1.0)).xyz - focus);
  gl_Position = vec4(seen * scale, 1.0);
  facing = turn * mat3(place) * normal;
  shade = value;
}`;

const LIGHT = `
vec3 lit(vec3 colour, vec3 n) {
  vec3 key = normalize(vec3(-0.35, 0.55, 0.8)), fill = normalize(vec3(0.8, -0.1, 0.5));
  float bright = 0.34 + 0.12 * n.y + 0.5 * max(dot(n, key), 0.0) + 0.16 * max(dot(n, fill), 0.0);
  float gleam = pow(max(dot(reflect(-key, n), vec3(0.0, 0.0, 1.0)), 0.0), 28.0);
  return colour * bright + 0.10 * gleam;
}`;

const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
in vec3 facing;
in float shade;
uniform vec3 colour;
uniform float alpha;
uniform vec2 range;
uniform bool coloured;
uniform sampler2D map;
out vec4 result;
${LIGHT}
void main() {
  vec3 n = normalize(facing);
  if (n.z < 0.0) n = -n;
  vec3 base = colour;
  if (coloured) base = texture(map, vec2((shade - range.x) / (range.y - range.x), 0.5)).rgb;
  float rim = pow(1.0 - n.z, 2.0);
  float cover = alpha >= 1.0 ? 1.0 : mix(alpha, min(1.0, alpha + 0.5), rim);
  result = vec4(lit(base, n), cover);
}`;

/* A fibre's segment is a strip towards the eye, shaded as the cylinder that it stands for. */
const FIBRE_VERTEX = `#version 300 es
layout(location = 0) in vec3 from;
layout(location = 1) in vec3 to;
layout(location = 2) in float value;
layout(location = 3) in float there;
uniform mat4 place;
uniform mat3 turn;
uniform vec3 focus, scale;
uniform float radius;
out vec2 across;
out vec3 side;
out float shade;
void main() {
  vec3 a = turn * ((place * vec4(from, 1.0)).xyz - focus), b = turn * ((place * vec4(to, 1.0)).xyz - focus);
  vec2 along = b.xy - a.xy;
  along = length(along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
  side = vec3(-along.y, along.x, 0.0);
  float right = float(gl_VertexID & 1) * 2.0 - 1.0;
  bool end = gl_VertexID > 1;
  vec3 seen = (end ? b : a) + side * right * radius + vec3(along, 0.0) * (end ? 0.4 : -0.4) * radius;
  gl_Position = there > 0.5 ? vec4(seen * scale, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
  across = vec2(right, 0.0);
  shade = value;
}`;

const FIBRE_FRAGMENT = `#version 300 es
precision highp float;
in vec2 across;
in vec3 side;
in float shade;
uniform vec3 colour;
uniform vec2 range;
uniform bool coloured;
uniform sampler2D map;
out vec4 result;
${LIGHT}
void main() {
  vec3 base = colour;
  if (coloured) base = texture(map, vec2((shade - range.x) / (range.y - range.x), 0.5)).rgb;
  vec3 n = side * across.x + vec3(0.0, 0.0, sqrt(max(1.0 - across.x * across.x, 0.0)));
  result = vec4(lit(base, n) * 1.06, 1.0);
}`;

const BONE = [0.925, 0.89, 0.815];
const BACKGROUND = [0.953, 0.957, 0.965];

function makeViewer(canvas, scene, block) {
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
  if (!gl) return null;

  const surfaces = program(gl, SURFACE_VERTEX, SURFACE_FRAGMENT);
  const strips = program(gl, FIBRE_VERTEX, FIBRE_FRAGMENT);
  const maps = Object.fromEntries(Object.entries(COLOUR_MAPS).map(([name, stops]) => [name, texture(gl, stops)]));
  const bones = scene.bones.map((bone) => boneOf(gl, bone, block));
  const muscles = scene.muscles.map((muscle) => muscleOf(gl, muscle, block));
  const state = {
    frame: 0,
    bones: "solid",
    surfaces: scene.muscles.some((one) => one.surface) ? "translucent" : "hidden",
    fibres: true,
    by: "muscle",
    hidden: new Set(),
  };
  const home = cameraOf(scene.view.towards, boundsOf(muscles, bones));
  const camera = { ...home };
  const ranges = rangesOf(muscles);
  let waiting = false;
  const watchers = [];

  function invalidate() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(draw);
  }

  function draw() {
    waiting = false;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(...BACKGROUND, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
    gl.colorMask(true, true, true, true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const seen = eyeOf(camera, width / height, home.reach);

    const shown = muscles.filter((muscle) => !state.hidden.has(muscle.name) && state.frame < muscle.frames);
    if (state.bones === "solid") drawBones(seen, 1);
    if (state.fibres) for (const muscle of shown) if (muscle.fibres) drawFibres(seen, muscle);
    if (state.surfaces !== "hidden") {
      const alpha = state.surfaces === "solid" ? 1 : state.by === "muscle" || state.by === "stretch" ? 0.5 : 0.14;
      const skins = shown.filter((muscle) => muscle.surface);
      nearestOnly(alpha, () => skins.forEach((muscle) => drawMuscle(seen, muscle, alpha)));
    }
    if (state.bones === "translucent") nearestOnly(0.28, () => drawBones(seen, 0.28));
    for (const watcher of watchers) watcher(camera, canvas.clientHeight);
  }

  /* Of see-through surfaces the nearest one alone is drawn: first how far it is, then its colour. */
  function nearestOnly(alpha, paint) {
    if (alpha < 1) {
      gl.colorMask(false, false, false, false);
      paint();
      gl.colorMask(true, true, true, true);
      gl.enable(gl.BLEND);
      gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
    }
    paint();
    gl.disable(gl.BLEND);
  }

  function use(shader, seen) {
    gl.useProgram(shader.id);
    gl.uniformMatrix3fv(shader.at.turn, false, seen.turn);
    gl.uniform3fv(shader.at.focus, seen.focus);
    gl.uniform3fv(shader.at.scale, seen.scale);
  }

  function drawBones(seen, alpha) {
    use(surfaces, seen);
    gl.uniform1i(surfaces.at.coloured, 0);
    gl.uniform3fv(surfaces.at.colour, BONE);
    gl.uniform1f(surfaces.at.alpha, alpha);
    for (const bone of bones) {
      gl.uniformMatrix4fv(surfaces.at.place, false, bone.places[Math.min(state.frame, bone.places.length - 1)]);
      gl.bindVertexArray(bone.vertices);
      gl.drawElements(gl.TRIANGLES, bone.count, bone.type, 0);
    }
  }

  function drawMuscle(seen, muscle, alpha) {
    const skin = muscle.surface;
    const stretched = state.by === "stretch";
    use(surfaces, seen);
    gl.uniform1i(surfaces.at.coloured, stretched ? 1 : 0);
    gl.uniform3fv(surfaces.at.colour, state.by === "muscle" || stretched ? muscle.colour : [0.72, 0.62, 0.6]);
    gl.uniform1f(surfaces.at.alpha, stretched ? Math.max(alpha, 0.92) : alpha);
    if (stretched) paintBy(surfaces, ranges.stretch);
    gl.uniformMatrix4fv(surfaces.at.place, false, skin.place);
    gl.bindVertexArray(skin.vertices);
    skin.show(state.frame + 1, stretched);
    gl.drawElements(gl.TRIANGLES, skin.count, skin.type, 0);
  }

  function drawFibres(seen, muscle) {
    const fibres = muscle.fibres;
    const values = fibres.values[state.by];
    use(strips, seen);
    gl.uniform1i(strips.at.coloured, values ? 1 : 0);
    gl.uniform3fv(strips.at.colour, mixed(muscle.colour, state.surfaces === "hidden" ? 0.1 : 0.55));
    if (values) paintBy(strips, ranges[state.by]);
    gl.uniform1f(strips.at.radius, 0.0022 * home.half);
    gl.uniformMatrix4fv(strips.at.place, false, fibres.place);
    gl.bindVertexArray(fibres.vertices);
    fibres.show(state.frame, values);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, fibres.segments);
  }

  function paintBy(shader, range) {
    gl.uniform2f(shader.at.range, range.low, range.high);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, maps[range.map]);
    gl.uniform1i(shader.at.map, 0);
  }

  steer(canvas, camera, home, invalidate);
  new ResizeObserver(invalidate).observe(canvas);
  invalidate();
  return {
    state,
    camera,
    ranges,
    watch: (watcher) => watchers.push(watcher),
    set(changes) {
      Object.assign(state, changes);
      invalidate();
    },
    look(towards) {
      Object.assign(camera, home, towards ? anglesOf(towards) : {});
      invalidate();
    },
    /* What is drawn, as numbers: for tests. */
    pixels() {
      draw();
      const data = new Uint8Array(canvas.width * canvas.height * 4);
      gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
      return data;
    },
  };
}

/* ---- What is drawn ---------------------------------------------------------------------------------- */

function boneOf(gl, bone, block) {
  const points = movingOf(block, bone.points);
  const normals = arrayOf(block, bone.normals);
  const padded = new Int8Array((normals.length / 3) * 4);
  for (let i = 0, to = 0; i < normals.length; i += 3, to += 4) padded.set(normals.subarray(i, i + 3), to);
  const triangles = arrayOf(block, bone.triangles);
  const vertices = gl.createVertexArray();
  gl.bindVertexArray(vertices);
  attribute(gl, 0, points.whole, 3, gl.SHORT, false, 8);
  attribute(gl, 1, padded, 3, gl.BYTE, true, 4);
  elements(gl, triangles);
  const own = placeOf(points);
  const rows = bone.transforms || [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
  const places = [];
  for (let at = 0; at < rows.length; at += 12) places.push(composed(rows.slice(at, at + 12), own));
  return { vertices, places, count: triangles.length, type: indexType(gl, triangles), points };
}

function muscleOf(gl, muscle, block) {
  const surface = muscle.surface && skinOf(gl, muscle.surface, block);
  const fibres = muscle.fibres && fibresOf(gl, muscle.fibres, block);
  const frames = surface ? surface.points.frames - 1 : fibres ? fibres.points.frames : 0;
  return { name: muscle.name, colour: rgbOf(muscle.colour), surface, fibres, frames };
}

function skinOf(gl, skin, block) {
  const points = movingOf(block, skin.points);
  const triangles = arrayOf(block, skin.triangles);
  const vertices = gl.createVertexArray();
  gl.bindVertexArray(vertices);
  const places = attribute(gl, 0, points.whole, 3, gl.SHORT, false, 8);
  const normals = attribute(gl, 1, new Int8Array(points.points * 4), 3, gl.BYTE, true, 4);
  const values = attribute(gl, 2, new Float32Array(points.points), 1, gl.FLOAT, false, 4);
  elements(gl, triangles);
  const known = new Map();
  let current = -1;
  let measured = -1;

  function show(frame, stretched) {
    if (frame !== current) {
      if (!known.has(frame)) known.set(frame, normalsOf(points, triangles, frame));
      gl.bindBuffer(gl.ARRAY_BUFFER, places);
      gl.vertexAttribPointer(0, 3, gl.SHORT, false, 8, frame * points.points * 8);
      gl.bindBuffer(gl.ARRAY_BUFFER, normals);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, known.get(frame));
      current = frame;
    }
    if (stretched && frame !== measured) {
      gl.bindBuffer(gl.ARRAY_BUFFER, values);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, stretchOf(points, triangles, frame));
      measured = frame;
    }
  }
  return { vertices, show, points, triangles, place: placeOf(points), count: triangles.length, type: indexType(gl, triangles) };
}

function fibresOf(gl, fibres, block) {
  const points = movingOf(block, fibres.points);
  const sizes = arrayOf(block, fibres.sizes);
  const segments = points.points - 1;
  const there = new Float32Array(points.points);
  const owner = new Uint32Array(points.points);
  for (let fibre = 0, at = 0; fibre < sizes.length; fibre++) {
    for (let k = 0; k < sizes[fibre]; k++, at++) {
      there[at] = k < sizes[fibre] - 1 ? 1 : 0;
      owner[at] = fibre;
    }
  }
  const values = {};
  for (const name of ["strain", "length", "depth"]) if (fibres[name]) values[name] = arrayOf(block, fibres[name]);
  const vertices = gl.createVertexArray();
  gl.bindVertexArray(vertices);
  const places = attribute(gl, 0, points.whole, 3, gl.SHORT, false, 8);
  attribute(gl, 3, there, 1, gl.FLOAT, false, 4);
  const shades = attribute(gl, 2, new Float32Array(points.points), 1, gl.FLOAT, false, 4);
  gl.enableVertexAttribArray(1);
  for (let i = 0; i < 4; i++) gl.vertexAttribDivisor(i, 1);
  const spread = new Float32Array(points.points);

  function show(frame, shown) {
    gl.bindBuffer(gl.ARRAY_BUFFER, places);
    gl.vertexAttribPointer(0, 3, gl.SHORT, false, 8, frame * points.points * 8);
    gl.vertexAttribPointer(1, 3, gl.SHORT, false, 8, frame * points.points * 8 + 8);
    if (!shown) return;
    for (let i = 0; i < spread.length; i++) spread[i] = shown[frame * fibres.count + owner[i]];
    gl.bindBuffer(gl.ARRAY_BUFFER, shades);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, spread);
  }
  return { vertices, show, points, values, segments, place: placeOf(points) };
}

/* Unit normals of a frame's points, the mean over their triangles by area. */
function normalsOf(points, triangles, frame) {
  const at = frame * points.row;
  const { whole } = points;
  const sum = new Float32Array(points.points * 3);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = at + triangles[t] * 4;
    const b = at + triangles[t + 1] * 4;
    const c = at + triangles[t + 2] * 4;
    const ux = whole[b] - whole[a], uy = whole[b + 1] - whole[a + 1], uz = whole[b + 2] - whole[a + 2];
    const vx = whole[c] - whole[a], vy = whole[c + 1] - whole[a + 1], vz = whole[c + 2] - whole[a + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (let corner = 0; corner < 3; corner++) {
      const to = triangles[t + corner] * 3;
      sum[to] += nx;
      sum[to + 1] += ny;
      sum[to + 2] += nz;
    }
  }
  const normals = new Int8Array(points.points * 4);
  for (let i = 0; i < points.points; i++) {
    const x = sum[3 * i], y = sum[3 * i + 1], z = sum[3 * i + 2];
    const scale = 127 / (Math.hypot(x, y, z) || 1);
    normals.set([x * scale, y * scale, z * scale], 4 * i);
  }
  return normals;
}

/* By how much the edges at each point are longer than at rest, which is frame 0 [%]. */
function stretchOf(points, triangles, frame) {
  const { whole, row } = points;
  const now = new Float32Array(points.points);
  const rest = new Float32Array(points.points);
  for (let t = 0; t < triangles.length; t += 3) {
    for (let corner = 0; corner < 3; corner++) {
      const i = triangles[t + corner], j = triangles[t + ((corner + 1) % 3)];
      const before = distance(whole, i * 4, j * 4), after = distance(whole, frame * row + i * 4, frame * row + j * 4);
      now[i] += after;
      now[j] += after;
      rest[i] += before;
      rest[j] += before;
    }
  }
  return now.map((value, i) => (rest[i] > 0 ? 100 * (value / rest[i] - 1) : 0));
}

function distance(whole, i, j) {
  return Math.hypot(whole[i] - whole[j], whole[i + 1] - whole[j + 1], whole[i + 2] - whole[j + 2]);
}

/* ---- Colours ---------------------------------------------------------------------------------------- */

const COLOUR_MAPS = {
  diverging: ["#2b5c9e", "#6f9fd0", "#b9cfe4", "#e9e6e0", "#efb9a0", "#d4694f", "#9c1f2b"],
  sequential: ["#fde9a9", "#f5b35e", "#dd6f4e", "#a83a5f", "#652a67", "#2a1a4a"],
};

/* Scales that all muscles and frames share, so that one red is one strain. */
function rangesOf(muscles) {
  const all = (name) => {
    const found = muscles.flatMap((one) => (one.fibres && one.fibres.values[name] ? [one.fibres.values[name]] : []));
    return Float32Array.from(found.flatMap((one) => Array.from(one))).sort();
  };
  const part = (sorted, share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
  const ranges = {};
  const strain = all("strain").map(Math.abs).sort();
  if (strain.length) {
    const limit = Math.max(1, part(strain, 0.98));
    ranges.strain = { low: -limit, high: limit, map: "diverging", unit: "%", open: true };
  }
  const length = all("length");
  if (length.length) ranges.length = { low: part(length, 0), high: part(length, 1), map: "sequential", unit: "mm" };
  const depth = all("depth");
  if (depth.length) ranges.depth = { low: 0, high: Math.max(1, part(depth, 1)), map: "sequential", unit: "mm" };
  const skins = muscles.filter((one) => one.surface && one.frames);
  if (skins.length) {
    const last = skins.map((one) => stretchOf(one.surface.points, one.surface.triangles, one.frames));
    const sorted = Float32Array.from(last.flatMap((one) => Array.from(one, Math.abs))).sort();
    const limit = Math.max(5, part(sorted, 0.95));
    ranges.stretch = { low: -limit, high: limit, map: "diverging", unit: "%", open: true };
  }
  return ranges;
}

function rgbOf(hex) {
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
}

function mixed(colour, white) {
  return colour.map((part) => part + (1 - part) * white);
}

function texture(gl, stops) {
  const colours = stops.map(rgbOf);
  const data = new Uint8Array(256 * 4);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (colours.length - 1);
    const k = Math.min(Math.floor(at), colours.length - 2);
    for (let c = 0; c < 3; c++) data[4 * i + c] = 255 * (colours[k][c] + (at - k) * (colours[k + 1][c] - colours[k][c]));
    data[4 * i + 3] = 255;
  }
  const id = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, id);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, data);
  for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
  for (const way of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, way, gl.LINEAR);
  return id;
}

/* ---- The eye ---------------------------------------------------------------------------------------- */

function boundsOf(muscles, bones) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  const add = ({ whole, origin, step }) => {
    for (let i = 0; i < whole.length; i += 4) {
      for (let axis = 0; axis < 3; axis++) {
        const value = origin[axis] + step * whole[i + axis];
        low[axis] = Math.min(low[axis], value);
        high[axis] = Math.max(high[axis], value);
      }
    }
  };
  for (const muscle of muscles) for (const part of [muscle.surface, muscle.fibres]) if (part) add(part.points);
  if (low[0] === Infinity) bones.forEach((bone) => add(bone.points));
  return { low, high };
}

function anglesOf(towards) {
  const [x, y, z] = towards;
  return { azimuth: Math.atan2(y, x), elevation: Math.asin(z / Math.hypot(x, y, z)) };
}

function cameraOf(towards, { low, high }) {
  const focus = low.map((value, axis) => (value + high[axis]) / 2);
  const reach = Math.hypot(...low.map((value, axis) => high[axis] - value)) / 2;
  return { ...anglesOf(towards), focus, half: 0.77 * reach, reach };
}

function axesOf({ azimuth, elevation }) {
  const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], towards: [ce * ca, ce * sa, se] };
}

function eyeOf(camera, aspect, reach) {
  const { right, up, towards } = axesOf(camera);
  const half = aspect < 1 ? (1.15 * camera.half) / aspect : camera.half;
  const turn = new Float32Array([0, 1, 2].flatMap((axis) => [right[axis], up[axis], towards[axis]]));
  return { turn, focus: camera.focus, scale: [1 / (half * aspect), 1 / half, -1 / (20 * reach)] };
}

/* Turn by dragging, shift by dragging with Shift or the other button, zoom by the wheel where the scene has
   the focus, by two fingers, or by keys. */
function steer(canvas, camera, home, changed) {
  const fingers = new Map();

  function turn(dx, dy) {
    camera.azimuth -= dx;
    camera.elevation = Math.max(-1.55, Math.min(1.55, camera.elevation + dy));
    changed();
  }
  function shift(dx, dy) {
    const { right, up } = axesOf(camera);
    const per = (2 * camera.half) / Math.min(canvas.clientHeight, canvas.clientWidth);
    camera.focus = camera.focus.map((value, axis) => value - per * (dx * right[axis] - dy * up[axis]));
    changed();
  }
  function zoom(factor) {
    camera.half = Math.max(home.half / 40, Math.min(home.half * 6, camera.half * factor));
    changed();
  }

  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const apart = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]) || 1;
      zoom(apart(before) / apart(now));
      shift(dx / 2, dy / 2);
    } else if (event.shiftKey || event.buttons > 1) shift(dx, dy);
    else turn(dx * 0.008, dy * 0.008);
    fingers.set(event.pointerId, now);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      zoom(Math.exp(event.deltaY * 0.0012));
    },
    { passive: false },
  );
  const keys = {
    ArrowLeft: () => turn(-0.1, 0),
    ArrowRight: () => turn(0.1, 0),
    ArrowUp: () => turn(0, -0.1),
    ArrowDown: () => turn(0, 0.1),
    "+": () => zoom(0.85),
    "=": () => zoom(0.85),
    "-": () => zoom(1.18),
    0: () => Object.assign(camera, home) && changed(),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key]();
  });
}

/* ---- WebGL ------------------------------------------------------------------------------------------ */

function program(gl, vertex, fragment) {
  const id = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(id, shader);
  }
  gl.linkProgram(id);
  if (!gl.getProgramParameter(id, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(id));
  const at = {};
  for (let i = 0; i < gl.getProgramParameter(id, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(id, i);
    at[name] = gl.getUniformLocation(id, name);
  }
  return { id, at };
}

function attribute(gl, place, data, size, type, normalised, stride) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, size, type, normalised, stride, 0);
  return buffer;
}

function elements(gl, triangles) {
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
}

function indexType(gl, triangles) {
  return triangles instanceof Uint32Array ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT;
}

/* From whole steps to the scene's coordinates, column by column. */
function placeOf({ origin, step }) {
  return new Float32Array([step, 0, 0, 0, 0, step, 0, 0, 0, 0, step, 0, ...origin, 1]);
}

/* A rigid transform (three rows of four) after a place. */
function composed(rows, place) {
  const result = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 3; row++) {
      let sum = column === 3 ? rows[4 * row + 3] : 0;
      for (let k = 0; k < 3; k++) sum += rows[4 * row + k] * place[4 * column + k];
      result[4 * column + row] = sum;
    }
  }
  result[15] = 1;
  return result;
}
