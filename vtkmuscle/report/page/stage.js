/* What is around a scene: its muscles by name, its views, a scale bar, and axes. */

function aroundScene(viewer, mm, canvas) {
  for (const box of document.querySelectorAll("[data-muscle]")) {
    box.addEventListener("change", () => {
      viewer.state.hidden[box.checked ? "delete" : "add"](box.dataset.muscle);
      viewer.set({});
    });
  }
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => viewer.look(button.dataset.view ? button.dataset.view.split(" ").map(Number) : null));
  }
  const ruler = document.getElementById("ruler");
  const axes = document.getElementById("axes");
  viewer.watch((camera, height) => {
    const bar = scaleBar(camera, canvas.clientWidth, height, mm);
    ruler.style.width = `${bar.width}px`;
    ruler.textContent = bar.words;
    drawAxes(axes, axesOf(camera));
  });
}

function plain(value) {
  return String(Number(value.toFixed(2)));
}

/* A scale bar of a round length, some 90 pixels wide. */
function scaleBar(camera, width, height, mm) {
  const perUnit = height / (2 * heightOf(camera, width / height));
  const wanted = (90 / perUnit) * mm;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const nice = [5, 2, 1].find((digit) => digit * power <= wanted) * power;
  return { width: (nice / mm) * perUnit, words: `${plain(nice)} mm` };
}

function drawAxes(svg, { right, up }) {
  const ends = [0, 1, 2].map((axis) => [24 * right[axis], -24 * up[axis]]);
  const marks = ["x", "y", "z"].map((name, axis) => {
    const [x, y] = ends[axis];
    // One that points at the eye, or is hidden by a longer one, has no place for its name.
    const hides = (other) => Math.hypot(...other) > Math.hypot(x, y) && Math.hypot(other[0] - x, other[1] - y) < 10;
    if (Math.hypot(x, y) < 6 || ends.some(hides)) return "";
    return `<line x1="0" y1="0" x2="${x.toFixed(1)}" y2="${y.toFixed(1)}"/><text x="${(1.35 * x).toFixed(1)}" y="${(1.35 * y + 4).toFixed(1)}">${name}</text>`;
  });
  svg.innerHTML = marks.join("");
}
