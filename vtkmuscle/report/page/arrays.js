/* Arrays of the page: one block, compressed and written as text, and what is found in it. */

async function inflated(id) {
  const text = document.getElementById(id).textContent.trim();
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

const KINDS = { u8: Uint8Array, i8: Int8Array, u16: Uint16Array, u32: Uint32Array, f32: Float32Array };

function arrayOf(block, where) {
  return new KINDS[where.type](block, where.at, where.count);
}

/* Points that move, as whole steps: (frames, points, 4), the fourth of them unused (rows of eight bytes).
   Of each frame the page holds by how much it differs from where the two before it lead to. */
function movingOf(block, where) {
  const low = arrayOf(block, where.low);
  const high = arrayOf(block, where.high);
  const { frames, points } = where;
  const whole = new Int16Array(frames * points * 4);
  const row = points * 4;
  for (let frame = 0, from = 0; frame < frames; frame++) {
    for (let point = 0; point < points; point++) {
      for (let axis = 0; axis < 3; axis++, from++) {
        const folded = low[from] + 256 * high[from];
        let value = (folded >> 1) ^ -(folded & 1);
        const to = frame * row + point * 4 + axis;
        if (frame === 1) value += whole[to - row];
        if (frame > 1) value += 2 * whole[to - row] - whole[to - 2 * row];
        whole[to] = value;
      }
    }
  }
  return { frames, points, row, whole, origin: where.origin, step: where.step };
}
