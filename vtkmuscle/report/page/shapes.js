/* Bones, muscles and fibres as the graphics card has them, frame by frame. */

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
  return { name: muscle.name, colour: rgbOf(muscle.colour), width: muscle.width || 1, surface, fibres, frames };
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
