/* The few calls of WebGL that everything drawn needs. */

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
