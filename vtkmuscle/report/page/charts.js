/* Charts of lines and bands as SVG: values where the pointer is, a zoom by dragging, a double click to undo it. */

function svgOf(name, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

/* Draw traces into an element; `choose` is called with the x of a click, `at` is the x of the dotted line. */
function drawChart(chart, traces, labels, at, choose) {
  const hidden = new Map((chart.data ?? []).map((one) => [one.name, one.visible]));
  for (const one of traces) if (hidden.has(one.name) && chart.labels.y === labels.y) one.visible = hidden.get(one.name);
  if (chart.labels?.x !== labels.x) chart.zoom = null;
  Object.assign(chart, { data: traces, labels, at });
  if (!chart.frame) {
    chart.frame = [0, 0, 0, 0];
    listen(chart, choose);
    new ResizeObserver(() => render(chart)).observe(chart);
  }
  render(chart);
}

function render(chart, width = chart.clientWidth, height = chart.clientHeight) {
  if (!chart.data || !width) return;
  const legend = legendOf(chart);
  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  chart.replaceChildren(legend, tip);
  height -= legend.offsetHeight;
  const shown = chart.data.filter((one) => one.visible !== false);
  const [left, right] = chart.zoom ?? ends(shown.flatMap((one) => one.x.filter((x) => x !== null)));
  const [low, high] = rangeOf(shown.map((one) => inside(one, left, right)));
  const words = chart.labels.y.split("\n");
  const rows = ticks(low, high, height / 55);
  const frame = [40 + 15 * (words.length - 1) + 7.5 * Math.max(...rows.map((one) => one.words.length)), 14, width - 14, height - (chart.labels.note ? 62 : 46)];
  const X = (x) => frame[0] + ((x - left) / (right - left)) * (frame[2] - frame[0]);
  const Y = (y) => frame[3] - ((y - low) / (high - low)) * (frame[3] - frame[1]);
  const svg = svgOf("svg", { width, height, viewBox: `0 0 ${width} ${height}`, "font-size": 13, "font-family": "system-ui, sans-serif", fill: "#2a2a2e" });
  const text = (x, y, content, more = {}) => svg.append(svgOf("text", { x, y, "text-anchor": "middle", ...more }, content));
  const line = (x1, y1, x2, y2, stroke) => svg.append(svgOf("line", { x1, y1, x2, y2, stroke }));
  for (const { value, words: number } of rows) {
    line(frame[0], Y(value), frame[2], Y(value), value === 0 ? "#bdbab2" : "#e7e5df");
    text(frame[0] - 8, Y(value) + 4.5, number, { "text-anchor": "end" });
  }
  for (const { value, words: number } of ticks(left, right, width / 90)) {
    line(X(value), frame[1], X(value), frame[3] + 5, "#e7e5df");
    text(X(value), frame[3] + 20, number);
  }
  const middle = (frame[1] + frame[3]) / 2;
  words.forEach((part, k) => text(15 + 15 * k, middle, part, { transform: `rotate(-90 ${15 + 15 * k} ${middle})` }));
  text((frame[0] + frame[2]) / 2, frame[3] + 40, chart.labels.x);
  if (chart.labels.note) text((frame[0] + frame[2]) / 2, frame[3] + 56, chart.labels.note, { "font-size": 10.5 });
  const clip = `clip-${chart.id}`;
  svg.append(svgOf("clipPath", { id: clip }, svgOf("rect", { x: frame[0], y: frame[1], width: frame[2] - frame[0], height: frame[3] - frame[1] })));
  const drawing = svgOf("g", { "clip-path": `url(#${clip})`, fill: "none", "stroke-linejoin": "round" });
  const cursor = svgOf("line", { class: "cursor", y1: frame[1], y2: frame[3], stroke: "#55555c", "stroke-width": 1.2, "stroke-dasharray": "2 3" });
  drawing.append(cursor, ...shown.flatMap((one) => marksOf(one, X, Y)));
  svg.append(drawing, svgOf("g", { class: "pointed" }));
  chart.prepend(svg);
  Object.assign(chart, { frame, X, Y, value: (pixel) => left + ((pixel - frame[0]) / (frame[2] - frame[0])) * (right - left) });
  moveCursor(chart, chart.at);
}

function moveCursor(chart, at) {
  chart.at = at;
  const cursor = chart.querySelector(".cursor");
  for (const end of cursor ? ["x1", "x2"] : []) cursor.setAttribute(end, chart.X(at));
}

function marksOf({ x, y, meta, mode, colour, width, dash, opacity = 1 }, X, Y) {
  if (meta) {
    const corner = (side) => (i) => `${X(meta.x[i]).toFixed(1)} ${Y(side[i]).toFixed(1)}`;
    // A ring per step, all the same way round: where a walk turns back, rings of both ways would cancel.
    const steps = [...meta.low.keys()].slice(1).filter((i) => meta.low[i] !== null && meta.low[i - 1] !== null);
    const pairs = steps.map((i) => (meta.x[i - 1] <= meta.x[i] ? [i - 1, i] : [i, i - 1]));
    const rings = pairs.map(([a, b]) => [...[a, b].map(corner(meta.low)), ...[b, a].map(corner(meta.high))]);
    return [svgOf("path", { d: rings.map((ring) => `M${ring.join("L")}Z`).join(""), fill: colour, "fill-opacity": opacity })];
  }
  if (mode === "markers") return x.map((at, i) => svgOf("circle", { cx: X(at), cy: Y(y[i]), r: 4, fill: colour }));
  let pen = "M";
  const parts = [];
  x.forEach((at, i) => {
    const drawn = at !== null && y[i] !== null;
    if (drawn) parts.push(`${pen}${X(at).toFixed(1)} ${Y(y[i]).toFixed(1)}`);
    pen = drawn ? "L" : "M";
  });
  return [svgOf("path", { d: parts.join(""), stroke: colour, "stroke-width": width, "stroke-dasharray": { dash: "7 5", dot: "2 4" }[dash] ?? "none", opacity })];
}

function legendOf(chart) {
  const legend = document.createElement("div");
  legend.className = "names";
  for (const one of chart.data.filter(({ listed }) => listed !== false)) {
    const button = document.createElement("button");
    button.type = "button";
    button.setAttribute("aria-pressed", one.visible !== false);
    const swatch = document.createElement("i");
    swatch.style.background = one.meta ? `color-mix(in srgb, ${one.colour} ${100 * one.opacity + 15}%, white)` : one.colour;
    swatch.style.height = one.meta ? ".7em" : one.width > 2 ? "3px" : "2px";
    button.append(swatch, one.name);
    button.addEventListener("click", () => {
      one.visible = one.visible === false;
      render(chart);
    });
    legend.append(button);
  }
  return legend;
}

function listen(chart, choose) {
  let from = null;
  const pixel = (event) => Math.max(chart.frame[0], Math.min(chart.frame[2], event.clientX - chart.getBoundingClientRect().left));
  const within = (event) => event.target.closest("svg") && chart.contains(event.target);
  chart.addEventListener("pointerdown", (event) => (from = within(event) && event.pointerType === "mouse" ? pixel(event) : null));
  chart.addEventListener("pointerup", (event) => {
    const to = pixel(event);
    if (from !== null && Math.abs(to - from) > 8) {
      chart.zoom = [chart.value(Math.min(from, to)), chart.value(Math.max(from, to))];
      render(chart);
    } else if (within(event)) choose(chart.value(to));
    from = null;
  });
  chart.addEventListener("dblclick", () => {
    chart.zoom = null;
    render(chart);
  });
  chart.addEventListener("pointermove", (event) => point(chart, within(event) ? chart.value(pixel(event)) : null, from === null ? null : [from, pixel(event)]));
  chart.addEventListener("pointerleave", () => point(chart, null, null));
}

/* The values of all lines at the place that is nearest to the pointer, or the part that is being chosen. */
function point(chart, wanted, chosen) {
  const [pointed, tip] = [chart.querySelector(".pointed"), chart.querySelector(".tip")];
  pointed.replaceChildren();
  const lines = chart.data.filter((one) => one.told && one.visible !== false);
  tip.hidden = wanted === null || !lines.length;
  if (tip.hidden) return;
  const [, top, , bottom] = chart.frame;
  if (chosen) {
    const [first, last] = ends(chosen);
    pointed.append(svgOf("rect", { x: first, y: top, width: last - first, height: bottom - top, fill: "#1d5fa8", "fill-opacity": 0.12 }));
  }
  const all = lines.flatMap((one) => one.x);
  const at = all[nearest(all, wanted)];
  pointed.append(svgOf("line", { x1: chart.X(at), x2: chart.X(at), y1: top, y2: bottom, stroke: "#8b8982" }));
  const row = (words, colour) => {
    const made = document.createElement("div");
    made.textContent = words;
    if (colour) made.style.borderLeft = `4px solid ${colour}`;
    return made;
  };
  const near = lines.map((one) => [one, nearest(one.x, at)]).filter(([one, i]) => Math.abs(one.x[i] - at) < 1e-6 * Math.max(1, Math.abs(at)) && one.y[i] !== null);
  for (const [one, i] of near) pointed.append(svgOf("circle", { cx: chart.X(at), cy: chart.Y(one.y[i]), r: 3.5, fill: one.colour }));
  tip.replaceChildren(row(numberIn(at)), ...near.map(([one, i]) => row(`${one.name}: ${numberIn(one.y[i])}`, one.colour)));
  tip.style.left = chart.X(at) > chart.clientWidth / 2 ? `${chart.X(at) - tip.offsetWidth - 12}px` : `${chart.X(at) + 12}px`;
}

function numberIn(value) {
  return String(Number(value.toPrecision(4))).replace("-", "\u2212");
}

function ends(values) {
  const [low, high] = values.reduce(([least, most], one) => [Math.min(least, one), Math.max(most, one)], [Infinity, -Infinity]);
  return low < high ? [low, high] : Number.isFinite(low) ? [low - 1, high + 1] : [0, 1];
}

function ticks(low, high, most) {
  const raw = (high - low) / Math.max(2, most);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5, 10].find((one) => one * power >= raw) ?? 10);
  const first = Math.ceil(low / step - 1e-9);
  const values = Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, k) => (first + k) * step);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return values.map((value) => ({ value, words: value.toFixed(Math.min(digits, 12)).replace("-", "\u2212") }));
}

/* A trace without what is outside of a zoom. */
function inside(one, left, right) {
  const kept = one.meta ? one.meta.x : one.x;
  const at = [...kept.keys()].filter((i) => kept[i] !== null && kept[i] >= left && kept[i] <= right);
  const part = (values) => at.map((i) => values[i]);
  return one.meta ? { low: part(one.meta.low), high: part(one.meta.high) } : { y: part(one.y) };
}

/* An axis that a spike does not flatten: all curves, and bands but for their last twentieth, where that is much less. */
function rangeOf(parts) {
  const values = (one) => (one.y ?? [...one.low, ...one.high]).filter((value) => value !== null);
  const share = (list, part) => (list = list.filter((value) => value !== null).sort((a, b) => a - b))[Math.round(part * (list.length - 1))];
  const filled = parts.filter((one) => values(one).length);
  const whole = ends(filled.flatMap(values));
  const most = ends(filled.flatMap((one) => (one.y ? values(one) : [share(one.low, 0.05), share(one.high, 0.95)])));
  const [low, high] = whole[1] - whole[0] <= 2 * (most[1] - most[0]) ? whole : most;
  return [low - 0.06 * (high - low), high + 0.06 * (high - low)];
}
