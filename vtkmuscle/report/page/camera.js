/* From where the scene is seen, and how that is changed. */

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
