/* The curves of a comparison: runs over one another, and beside them how far they are from the first. */

function withError({ x, mean, error, colour, label }) {
  const style = { colour, label };
  if (!error) return [line(x, mean, style, label)];
  const [low, high] = [mean.map((value, i) => value - error[i]), mean.map((value, i) => value + error[i])];
  return [...band(x, low, high, colour, 0.2, `${label}: error`, false), line(x, mean, style, label)];
}

function published(curve, k) {
  const colour = ["#8b8982", "#b5a642", "#5e7f73", "#7a6a8a"][k % 4];
  if (curve.low) return band(curve.x, curve.low, curve.high, colour, 0.25, curve.label, true);
  const single = curve.x.length === 1;
  return [{ x: curve.x, y: curve.y, mode: single ? "markers" : "lines", line: { color: colour, dash: "dot" }, marker: { color: colour, symbol: "diamond", size: 8 }, name: curve.label }];
}

async function begin() {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflated("plotly"));
  document.head.append(script);
  const charts = JSON.parse(document.getElementById("data").textContent);
  const draw = (id, traces, x, y) => {
    const chart = document.getElementById(id);
    return Plotly.react(chart, traces, layoutOf(chart, traces, x, y), CONFIG);
  };
  for (const chart of charts) {
    await draw(chart.id, [...chart.literature.flatMap(published), ...chart.runs.flatMap(withError)], chart.x, chart.y);
    if (chart.differences.length) await draw(`${chart.id}-apart`, chart.differences.flatMap(withError), chart.x, `difference [${chart.y.split("[").at(-1)}`);
    else document.getElementById(`${chart.id}-apart`).closest("figure").remove();
  }
  csvButtons();
  const all = [...document.querySelectorAll(".js-plotly-plot")];
  window.addEventListener("beforeprint", () => all.forEach((chart) => Plotly.relayout(chart, ONTO_PAPER)));
  window.addEventListener("afterprint", () => all.forEach((chart) => Plotly.relayout(chart, offPaper(chart))));
  document.documentElement.dataset.ready = "yes";
}

begin().catch((error) => {
  const place = document.getElementById("failed");
  place.hidden = false;
  place.append(` ${error}`);
  throw error;
});
