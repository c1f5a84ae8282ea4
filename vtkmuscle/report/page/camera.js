/* From where the scene is seen, and how that is changed. */

/* How many times as large as the muscles the first view may be to show bones whole, and how much of them it
   shows about the muscles where that does not do. */
const WHOLE_BONES = 2;
const ABOUT = 1.3;
/* Room between what is framed and the rim. */
const RIM = 1.06;

function anglesOf(towards) {
  const [x, y, z] = towards;
  return { azimuth: Math.atan2(y, x), elevation: Math.asin(z / Math.hypot(x, y, z)) };
}

/* The lowest and highest right, up and towards of points, given as whole numbers of steps with their place in
   the scene (4 x 4, column by column); of many points some. */
function boxOf(parts, { right, up, towards }) {
  const box = { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] };
  for (const { whole, place } of parts) {
    const every = 4 * Math.max(1, Math.floor(whole.length / 4 / 20000));
    for (let i = 0; i < whole.length; i += every) {
      const point = [0, 1, 2].map((row) => place[row] * whole[i] + place[4 + row] * whole[i + 1] + place[8 + row] * whole[i + 2] + place[12 + row]);
      [right, up, towards].forEach((axis, k) => {
        const value = axis[0] * point[0] + axis[1] * point[1] + axis[2] * point[2];
        box.low[k] = Math.min(box.low[k], value);
        box.high[k] = Math.max(box.high[k], value);
      });
    }
  }
  return box;
}

function joined(one, other) {
  return { low: one.low.map((value, k) => Math.min(value, other.low[k])), high: one.high.map((value, k) => Math.max(value, other.high[k])) };
}

function grown({ low, high }, factor) {
  const more = low.map((value, k) => ((factor - 1) * (high[k] - value)) / 2);
  return { low: low.map((value, k) => value - more[k]), high: high.map((value, k) => value + more[k]) };
}

/* The part of a box that is inside another. */
function within(box, other) {
  return { low: box.low.map((value, k) => Math.max(value, other.low[k])), high: box.high.map((value, k) => Math.min(value, other.high[k])) };
}

/* The view that frames muscles in all frames, with their bones in the first one: whole where muscles stay large
   enough, or else what is about the muscles. */
function cameraOf(angles, muscles, bones) {
  const axes = axesOf(angles);
  const parts = muscles.flatMap(({ surface, fibres }) => [surface, fibres]).filter(Boolean);
  const skeleton = boxOf(bones.map((bone) => ({ whole: bone.points.whole, place: bone.places[0] })), axes);
  const flesh = parts.length ? boxOf(parts.map((part) => ({ whole: part.points.whole, place: part.place })), axes) : skeleton;
  const all = bones.length ? joined(flesh, skeleton) : flesh;
  const size = ({ low, high }) => Math.max(high[0] - low[0], high[1] - low[1]);
  const seen = size(all) <= WHOLE_BONES * size(flesh) ? all : joined(flesh, within(all, grown(flesh, ABOUT)));
  const middle = seen.low.map((value, k) => (value + seen.high[k]) / 2);
  const focus = [0, 1, 2].map((row) => axes.right[row] * middle[0] + axes.up[row] * middle[1] + axes.towards[row] * middle[2]);
  const [wide, half] = [0, 1].map((k) => (RIM * (seen.high[k] - seen.low[k])) / 2);
  return { ...angles, focus, half, wide, reach: Math.hypot(...all.low.map((value, k) => all.high[k] - value)) / 2 };
}

/* Half the height of what a canvas of some width / height shows. */
function heightOf(camera, aspect) {
  return Math.max(camera.half, camera.wide / aspect);
}

function axesOf({ azimuth, elevation }) {
  const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], towards: [ce * ca, ce * sa, se] };
}

function eyeOf(camera, aspect, reach) {
  const { right, up, towards } = axesOf(camera);
  const half = heightOf(camera, aspect);
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
    const per = (2 * heightOf(camera, canvas.clientWidth / canvas.clientHeight)) / canvas.clientHeight;
    camera.focus = camera.focus.map((value, axis) => value - per * (dx * right[axis] - dy * up[axis]));
    changed();
  }
  function zoom(factor) {
    const now = camera.half / home.half;
    const next = Math.max(1 / 40, Math.min(6, now * factor));
    camera.half *= next / now;
    camera.wide *= next / now;
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
