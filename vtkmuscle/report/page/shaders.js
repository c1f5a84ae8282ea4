/* The programs of the graphics card: surfaces, and fibres as strips. */

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
