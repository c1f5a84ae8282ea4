/* Colours, and the scales that they stand for. */

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
