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

  function go(place) {
    slider.value = place;
    const position = shown[place];
    const words = `${data.curves.timeName} ${plain(data.curves.times[position])}${data.curves.timeUnit}`;
    readout.textContent = `${words}, frame ${data.frames[position]}`;
    slider.setAttribute("aria-valuetext", words);
    viewer?.set({ frame: place });
    curves.show(position);
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
  go(0);

  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflated("plotly"));
  document.head.append(script);
  choices(curves);
  await curves.draw();
  window.report = { viewer, curves, data, go };
  document.documentElement.dataset.ready = "yes";
}

function plain(value) {
  return String(Number(value.toFixed(2)));
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
  for (const box of document.querySelectorAll("[data-muscle]")) {
    box.addEventListener("change", () => {
      viewer.state.hidden[box.checked ? "delete" : "add"](box.dataset.muscle);
      viewer.set({});
    });
  }
  for (const button of document.querySelectorAll("[data-view]")) {
    const towards = button.dataset.view ? button.dataset.view.split(" ").map(Number) : null;
    button.addEventListener("click", () => viewer.look(towards));
  }
  document.getElementById("picture").addEventListener("click", () => {
    viewer.pixels();
    const link = document.createElement("a");
    link.href = canvas.toDataURL("image/png");
    link.download = "scene.png";
    link.click();
  });
  const ruler = document.getElementById("ruler");
  const axes = document.getElementById("axes");
  viewer.watch((camera, height) => {
    const half = heightOf(camera, canvas.clientWidth / height);
    const perUnit = height / (2 * half);
    const wanted = (90 / perUnit) * data.scene.mm;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const nice = [5, 2, 1].find((digit) => digit * power <= wanted) * power;
    ruler.style.width = `${(nice / data.scene.mm) * perUnit}px`;
    ruler.textContent = `${plain(nice)} mm`;
    drawAxes(axes, axesOf(camera));
  });
  viewer.set({});
}

function brief(value, unit) {
  const rounded = Math.abs(value) >= 10 || value === 0 ? value.toFixed(0) : value.toPrecision(2);
  return `${value > 0 && unit === "%" ? "+" : ""}${rounded} ${unit}`;
}

function drawAxes(svg, { right, up }) {
  const marks = ["x", "y", "z"].map((name, axis) => {
    const [x, y] = [24 * right[axis], -24 * up[axis]];
    return `<line x1="0" y1="0" x2="${x.toFixed(1)}" y2="${y.toFixed(1)}"/><text x="${(1.35 * x).toFixed(1)}" y="${(1.35 * y + 4).toFixed(1)}">${name}</text>`;
  });
  svg.innerHTML = marks.join("");
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
