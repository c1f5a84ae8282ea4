/* What the page does: unpacks its arrays, draws the scene and the curves, and joins them by the slider. */

async function begin() {
  const data = JSON.parse(document.getElementById("data").textContent);
  const block = await inflated("arrays");
  const slider = document.getElementById("time");
  const readout = document.getElementById("readout");
  const canvas = document.getElementById("canvas");
  const viewer = makeViewer(canvas, data.scene, block);
  if (!viewer) document.getElementById("no-webgl").hidden = false;
  const curves = makeCurves(data.curves, block, (position) => go(shownNear(data.scene.shown, position)));
  const { shown } = data.scene;

  let last;
  function go(place) {
    slider.value = place;
    const position = shown[place];
    const words = poseIn(data.curves, position);
    readout.textContent = `${words}, frame ${data.frames[position]}`;
    slider.setAttribute("aria-valuetext", words);
    viewer?.set({ frame: place });
    curves.show(position);
    tellArms(data.curves, position);
    if (last !== undefined && last !== place) history.replaceState(null, "", `#frame=${data.frames[position]}`);
    last = place;
  }

  function goToLink() {
    const [, wanted] = location.hash.match(/^#frame=(\d+)$/) || [];
    if (wanted === undefined) return false;
    go(shownNear(shown, nearest(data.frames, Number(wanted))));
    return true;
  }

  slider.addEventListener("input", () => go(Number(slider.value)));
  if (viewer) {
    controls(viewer, data, canvas);
    player(slider, go);
  }
  for (const button of document.querySelectorAll("[data-frame]")) {
    button.addEventListener("click", () => {
      stopPlaying();
      go(shownNear(shown, data.frames.indexOf(Number(button.dataset.frame))));
      document.getElementById("scene").scrollIntoView({ behavior: "smooth" });
    });
  }
  if (!goToLink()) go(0);
  window.addEventListener("hashchange", goToLink);

  choices(curves);
  curves.draw();
  forPaper(curves, viewer);
  window.report = { viewer, curves, data, go };
  document.documentElement.dataset.ready = "yes";
}

function shownNear(shown, position) {
  return nearest(shown, position);
}

/* ---- Beside the scene -------------------------------------------------------------------------------- */

function controls(viewer, data, canvas) {
  const legend = document.getElementById("legend");
  const by = document.getElementById("colour-by");
  for (const option of by.options) option.disabled = option.value !== "muscle" && !viewer.ranges[option.value];
  const showLegend = () => {
    const range = viewer.ranges[by.value];
    legend.hidden = !range;
    if (!range) return;
    const stops = COLOUR_MAPS[range.map].join(", ");
    legend.querySelector(".bar").style.background = `linear-gradient(to right, ${stops})`;
    const open = range.open ? ["≤ ", "≥ "] : ["", ""];
    const [low, middle, high] = [range.low, (range.low + range.high) / 2, range.high].map((value) => brief(value, range.unit));
    legend.querySelector(".low").textContent = open[0] + low;
    legend.querySelector(".middle").textContent = middle;
    legend.querySelector(".high").textContent = open[1] + high;
  };
  by.addEventListener("change", () => {
    viewer.set({ by: by.value });
    showLegend();
  });
  for (const name of ["bones", "surfaces"]) {
    const select = document.getElementById(`show-${name}`);
    if (!select) continue;
    select.value = viewer.state[name];
    select.addEventListener("change", () => viewer.set({ [name]: select.value }));
  }
  document.getElementById("show-fibres")?.addEventListener("change", (event) => viewer.set({ fibres: event.target.checked }));
  const front = document.getElementById("front");
  const nameSides = () => {
    const [x, y] = front.value.split(" ").map(Number);
    const named = { front: [x, y], back: [-x, -y], left: [-y, x], right: [y, -x] };
    const sides = Object.fromEntries(Object.entries(named).map(([name, side]) => [side.map((one) => one + 0).join(" "), name]));
    for (const button of document.querySelectorAll("[data-side]")) button.textContent = (front.value && sides[button.dataset.side]) || button.dataset.name;
  };
  front.addEventListener("change", nameSides);
  nameSides();
  for (const button of document.querySelectorAll("[data-picture]")) {
    button.addEventListener("click", () => save(labelled(viewer, data, canvas, Number(button.dataset.picture)).toDataURL("image/png"), "scene.png"));
  }
  aroundScene(viewer, data.scene.mm, canvas);
  viewer.set({});
}

/* The time of a frame, and the coordinates that are not the time. */
function poseIn({ timeName, timeUnit, times, coordinates }, position) {
  const own = coordinates.filter((one) => one.label !== timeName).map((one) => `, ${one.label} ${plain(one.values[position])} ${one.unit}`);
  return `${timeName} ${plain(times[position])}${timeUnit}${own.join("")}`;
}

/* The scene with its scale bar, its time or angle, and the scale of its colours. */
function labelled(viewer, data, canvas, times) {
  const picture = viewer.picture(times);
  const pen = picture.getContext("2d");
  const [width, height] = [picture.width / times, picture.height / times];
  pen.scale(times, times);
  pen.font = "15px system-ui, sans-serif";
  pen.fillStyle = "#000";
  const bar = scaleBar(viewer.camera, canvas.clientWidth, canvas.clientHeight, data.scene.mm);
  pen.fillRect(20, height - 20, bar.width, 3);
  pen.fillText(bar.words, 20, height - 27);
  const position = data.scene.shown[viewer.state.frame];
  pen.fillText(poseIn(data.curves, position), 20, 30);
  const by = document.getElementById("colour-by");
  const range = viewer.ranges[by.value];
  if (range) {
    const [left, top] = [width - 260, height - 40];
    const fill = pen.createLinearGradient(left, 0, left + 230, 0);
    COLOUR_MAPS[range.map].forEach((colour, k, all) => fill.addColorStop(k / (all.length - 1), colour));
    pen.fillStyle = fill;
    pen.fillRect(left, top, 230, 12);
    pen.fillStyle = "#000";
    pen.fillText(by.selectedOptions[0].textContent, left, top - 8);
    [[range.low, "left"], [(range.low + range.high) / 2, "center"], [range.high, "right"]].forEach(([value, side], k) => {
      pen.textAlign = side;
      pen.fillText(brief(value, range.unit), left + 115 * k, top + 28);
    });
  }
  return picture;
}

/* Moment arms at the slider's frame, on the cards. */
function tellArms(curves, position) {
  for (const place of document.querySelectorAll("[data-arm]")) {
    const [muscle, coordinate] = JSON.parse(place.dataset.arm);
    const found = curves.muscles.find((one) => one.name === muscle).arms[coordinate];
    const axis = curves.coordinates.find((one) => one.name === coordinate);
    const k = nearest(found.frames, position);
    const mean = found.mean[k].toFixed(1).replace("-", "\u2212");
    const unit = axis.of === "1" ? "" : " mm";
    const error = (found.held[1][k] - found.held[0][k]) / 2;
    const words = found.held[0][k] === null ? "" : `, error ${error.toFixed(1)}${unit}`;
    place.textContent = `${mean}${unit} at ${found.values[k].toFixed(1)} ${axis.unit}${words}`;
  }
}

/* On paper everything is open, as wide as the paper, and every coordinate and check has its curve. */
function forPaper(curves, viewer) {
  let closed = [];
  window.addEventListener("beforeprint", () => {
    closed = [...document.querySelectorAll("details:not([open])")];
    for (const one of closed) one.open = true;
    viewer?.pixels();
    curves.print(true);
  });
  window.addEventListener("afterprint", () => {
    for (const one of closed) one.open = false;
    curves.print(false);
  });
}

function brief(value, unit) {
  const rounded = Math.abs(value) >= 10 || value === 0 ? value.toFixed(0) : value.toPrecision(2);
  return `${value > 0 && unit === "%" ? "+" : ""}${rounded} ${unit}`;
}

/* ---- Playing ----------------------------------------------------------------------------------------- */

let playing = 0;

function stopPlaying() {
  clearInterval(playing);
  playing = 0;
  const button = document.getElementById("play");
  button.textContent = "▶ Play";
  button.setAttribute("aria-pressed", "false");
}

function player(slider, go) {
  const button = document.getElementById("play");
  button.addEventListener("click", () => {
    if (playing) return stopPlaying();
    let place = Number(slider.value);
    let way = place >= Number(slider.max) ? -1 : 1;
    button.textContent = "❚❚ Pause";
    button.setAttribute("aria-pressed", "true");
    playing = setInterval(() => {
      if (place + way < 0 || place + way > Number(slider.max)) way = -way;
      place = Math.max(0, Math.min(Number(slider.max), place + way));
      go(place);
    }, 66);
  });
  slider.addEventListener("pointerdown", stopPlaying);
  slider.addEventListener("keydown", stopPlaying);
}

/* ---- Above the curves -------------------------------------------------------------------------------- */

function choices(curves) {
  for (const radio of document.querySelectorAll("input[name=which]")) {
    radio.addEventListener("change", () => curves.set({ muscle: radio.value }));
  }
  document.getElementById("coordinate")?.addEventListener("change", (event) => curves.set({ coordinate: event.target.value }));
  const check = document.getElementById("check");
  if (!check) return;
  check.value = curves.state.check;
  check.addEventListener("change", () => curves.set({ check: check.value }));
}

begin().catch((error) => {
  const place = document.getElementById("failed");
  place.hidden = false;
  place.append(` ${error}`);
  throw error;
});
