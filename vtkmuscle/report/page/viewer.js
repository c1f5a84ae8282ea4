/* The scene in three dimensions, by WebGL 2: bones as rigid bodies, muscles and fibres point by point.
   Parallel projection with z up, as in the figures; it draws when something has changed. */

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
  const home = cameraOf(anglesOf(scene.view.towards), muscles, bones);
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
    paint(Math.min(window.devicePixelRatio || 1, 2), BACKGROUND);
    for (const watcher of watchers) watcher(camera, canvas.clientHeight);
  }

  function paint(ratio, background) {
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(...background, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
    gl.colorMask(true, true, true, true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const seen = eyeOf(camera, width / height, home.reach);

    const shown = muscles.filter((muscle) => !state.hidden.has(muscle.name) && state.frame < muscle.frames);
    if (state.bones === "solid") drawBones(seen, 1);
    const fibres = () => state.fibres && shown.filter((muscle) => muscle.fibres).forEach((muscle) => drawFibres(seen, muscle));
    const before = state.surfaces === "translucent" && state.by !== "muscle" && state.by !== "stretch";
    if (!before) fibres();
    if (state.surfaces !== "hidden") {
      const alpha = state.surfaces === "solid" ? 1 : before ? 0.3 : 0.5;
      const skins = shown.filter((muscle) => muscle.surface);
      nearestOnly(alpha, () => skins.forEach((muscle) => drawMuscle(seen, muscle, alpha)));
    }
    if (before) {
      // Nothing may tint the colours of a scale: fibres come before their muscle, and behind bones alone.
      gl.clear(gl.DEPTH_BUFFER_BIT);
      gl.colorMask(false, false, false, false);
      if (state.bones === "solid") drawBones(seen, 1);
      gl.colorMask(true, true, true, true);
      fibres();
    }
    if (state.bones === "translucent") nearestOnly(0.28, () => drawBones(seen, 0.28));
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
    gl.uniform3fv(surfaces.at.colour, state.by === "muscle" || stretched ? muscle.colour : [0.6, 0.59, 0.57]);
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
    gl.uniform3fv(strips.at.colour, mixed(muscle.colour, state.surfaces === "hidden" || muscle.width > 1 ? 0.1 : 0.55));
    if (values) paintBy(strips, ranges[state.by]);
    gl.uniform1f(strips.at.radius, 0.0022 * muscle.width * heightOf(home, canvas.width / canvas.height));
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
      Object.assign(camera, towards ? cameraOf(anglesOf(towards), muscles, bones) : home);
      invalidate();
    },
    /* What is drawn, on white, with some pixels for one of the page. */
    picture(times) {
      paint(times, [1, 1, 1]);
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [canvas.width, canvas.height];
      copy.getContext("2d").drawImage(canvas, 0, 0);
      draw();
      return copy;
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
