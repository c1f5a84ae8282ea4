/* Curves over the motion that answer to the pointer, by Plotly: lengths, moment arms, and how the shape was kept. */

const FONT = { family: "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif", size: 13, color: "#2a2a2e" };
const CONFIG = {
  displaylogo: false,
  responsive: true,
  modeBarButtons: [["toImage"], ["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
  toImageButtonOptions: { format: "svg" },
};

function makeCurves(data, block, choose) {
  const known = Object.fromEntries(data.muscles.map((muscle) => [muscle.name, muscle]));
  const state = { muscle: "", coordinate: data.coordinates[0]?.name, check: (data.checks.find((one) => !one.flat) ?? data.checks[0])?.key, at: 0 };
  const charts = ["lengths", "fibre-lengths", "arms", "checks"].map((id) => document.getElementById(id)).filter(Boolean);
  for (const chart of charts) chart.drawn = Promise.resolve();
  csvButtons();

  function chosen() {
    return state.muscle ? [known[state.muscle]] : data.muscles;
  }

  function lengths(id, key, what, label) {
    const single = Boolean(state.muscle);
    const traces = chosen().flatMap((muscle) => {
      if (!muscle[key]) return [];
      const { mean, low, high, lower, upper } = muscle[key];
      const times = data.times.slice(0, mean.length);
      const bands = [band(times, low, high, muscle.colour, single ? 0.16 : 0.1, `${muscle.label}: all ${what}`, single)];
      if (single) {
        bands.push(band(times, lower, upper, muscle.colour, 0.28, `middle half of the ${what}`, true));
        bands.push(...each(muscle, muscle[key], times, what));
      }
      return [...bands.flat(), line(times, mean, muscle, single ? `mean of the ${what}` : muscle.label)];
    });
    paint(id, traces, data.timeLabel, label);
  }

  function each(muscle, found, times, what) {
    const values = arrayOf(block, found.fibres);
    const { drawn } = found;
    const x = [], y = [];
    for (let k = 0; k < drawn; k++) {
      for (let i = 0; i < times.length; i++) {
        x.push(times[i]);
        y.push(values[i * drawn + k]);
      }
      x.push(null);
      y.push(null);
    }
    const style = { color: muscle.colour, width: 0.6 };
    return [{ x, y, mode: "lines", line: style, opacity: 0.45, name: `${drawn} single ${what}`, hoverinfo: "skip", visible: "legendonly" }];
  }

  function arms(id = "arms", named = state.coordinate) {
    const single = Boolean(state.muscle);
    const coordinate = data.coordinates.find((one) => one.name === named);
    if (!coordinate) return;
    const traces = chosen().flatMap((muscle) => {
      const found = muscle.arms?.[named];
      if (!found) return [];
      const { values, mean, low, high, quartic } = found;
      const parts = [band(values, low, high, muscle.colour, single ? 0.16 : 0.1, `${muscle.label}: all paths`, single)];
      if (single) {
        if (quartic) {
          const style = { color: "#2a2a2e", width: 1.2, dash: "dash" };
          parts.push({ x: values, y: quartic, mode: "lines", line: style, name: "quartic fit", hoverinfo: "skip" });
        }
        parts.push(...(found.literature || []).flatMap(published));
      }
      return [...parts.flat(), line(values, mean, muscle, single ? "mean of the paths" : muscle.label)];
    });
    const positive = coordinate.positive ? `<br><sup>positive: ${coordinate.positive}</sup>` : "";
    paint(id, traces, `${coordinate.label} [${coordinate.unit}]${positive}`, `moment arm [${coordinate.of}]`);
  }

  function published(curve) {
    if (curve.low) return band(curve.x, curve.low, curve.high, curve.colour, 0.25, curve.label, true);
    const single = curve.x.length === 1;
    const style = { color: curve.colour, width: 1.8, dash: "dot" };
    const marker = { color: curve.colour, symbol: "diamond", size: 8 };
    return [{ x: curve.x, y: curve.y, mode: single ? "markers" : "lines", line: style, marker, name: curve.label, hovertemplate: "%{y:.1f} mm" }];
  }

  function checks(id = "checks", key = state.check) {
    const check = data.checks.find((one) => one.key === key);
    if (!check) return;
    if (id === "checks") {
      const words = document.getElementById("check-words");
      words.textContent = check.flat ? `${check.label[0].toUpperCase()}${check.label.slice(1)}: ${check.flat}` : "";
      words.hidden = !check.flat;
      for (const one of ["checks", "checks-caption"]) document.getElementById(one).hidden = Boolean(check.flat);
    }
    if (check.flat) return;
    const traces = chosen().flatMap((muscle) => {
      const values = muscle.checks[check.key];
      return values ? [line(data.times.slice(0, values.length), values, muscle, muscle.label)] : [];
    });
    const limits = [[check.look, "look", "#8a5a00"], [check.failed, "failed", "#a3161f"]].filter(([limit]) => limit !== null);
    const tops = traces.flatMap((trace) => trace.y).concat(check.floor ?? []);
    const most = Math.max(...tops.map(Math.abs), 1e-9);
    for (const [limit, name, colour] of limits) {
      if (Math.abs(limit) > 3 * most && name === "failed") continue;
      const ends = [data.times[0], data.times.at(-1)];
      traces.push({ x: ends, y: [limit, limit], mode: "lines", line: { color: colour, width: 1.2, dash: "dash" }, name: `limit: ${name}`, hoverinfo: "skip" });
    }
    paint(id, traces, data.timeLabel, check.label.replace(/(.{18}\S*) /g, "$1<br>"));
  }

  function paint(id, traces, xLabel, yLabel) {
    const chart = document.getElementById(id);
    if (!chart) return;
    const layout = { ...layoutOf(chart, traces, xLabel, yLabel), shapes: [cursor(id)] };
    chart.drawn = chart.drawn.then(() => Plotly.react(chart, traces, layout, CONFIG)).then(() => {
      if (chart.heard) return;
      chart.heard = true;
      chart.on("plotly_click", (event) => choose(id === "arms" ? nearest(coordinateValues(), event.points[0].x) : nearest(data.times, event.points[0].x)));
    });
  }

  function coordinateValues() {
    return data.coordinates.find((one) => one.name === state.coordinate)?.values ?? data.times;
  }

  function cursor(id) {
    const x = id === "arms" ? coordinateValues()[state.at] : data.times[state.at];
    return { type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color: "#55555c", width: 1.2, dash: "dot" }, layer: "below" };
  }

  /* Charts of the coordinates and checks that are not chosen, for paper; gone after that. */
  function print(begin) {
    for (const chart of charts) {
      if (chart.data && !chart.hidden) Plotly.relayout(chart, begin ? ONTO_PAPER : offPaper(chart));
    }
    document.querySelectorAll(".printed").forEach((one) => one.remove());
    if (!begin) return;
    const more = (after, heading, make) => {
      const place = document.createElement("figure");
      place.className = "card wide printed";
      const id = `printed-${document.querySelectorAll(".printed").length}`;
      place.innerHTML = `<h3></h3><div id="${id}" style="height: ${TALL}px; width: ${PAPER}px"></div>`;
      place.firstChild.textContent = heading;
      document.getElementById(after).closest("figure").after(place);
      place.lastChild.drawn = { then: (draw) => (draw(), { then: () => {} }) }; // at once: paper does not wait
      make(id);
    };
    for (const one of data.coordinates) if (one.name !== state.coordinate) more("arms", `Moment arms by ${one.label}`, (id) => arms(id, one.name));
    for (const one of data.checks) if (one.key !== state.check && !one.flat) more("checks", one.label, (id) => checks(id, one.key));
  }

  let waiting = false;
  function move() {
    waiting = false;
    for (const chart of charts) if (chart.data && !chart.hidden) Plotly.relayout(chart, { shapes: [cursor(chart.id)] });
  }

  function all() {
    lengths("lengths", "lengths", "paths", "length, bone to bone [mm]");
    lengths("fibre-lengths", "fibreLengths", "fibres", "fibre length [mm]");
    arms();
    checks();
    return Promise.all(charts.map((chart) => chart.drawn));
  }

  return {
    state,
    draw: all,
    print,
    set(changes) {
      Object.assign(state, changes);
      return all();
    },
    show(position) {
      state.at = position;
      if (!waiting) requestAnimationFrame(move);
      waiting = true;
    },
  };
}

/* Width and height of a chart on paper [px], within the margins of A4; where its legend begins, of its height. */
const [PAPER, TALL, LEGEND] = [670, 320, -0.24];

const ONTO_PAPER = { autosize: false, width: PAPER, height: TALL, "legend.y": -0.32 };
function offPaper(chart) {
  return { autosize: true, width: null, height: chart.clientHeight, "legend.y": LEGEND };
}

function layoutOf(chart, traces, xLabel, yLabel) {
  const axis = { gridcolor: "#e7e5df", zerolinecolor: "#bdbab2", linecolor: "#8b8982", ticks: "outside", tickcolor: "#bdbab2", automargin: true };
  return {
    font: FONT,
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 58, r: 14, t: 34, b: 50 },
    height: chart.clientHeight || 380,
    hovermode: chart.clientWidth < 520 ? "closest" : "x unified",
    hoverlabel: { bgcolor: "#ffffff", font: { ...FONT, size: 12 } },
    xaxis: { ...axis, title: { text: xLabel, standoff: 10 } },
    yaxis: { ...axis, title: { text: yLabel, standoff: 8 }, ...rangeOf(traces) },
    legend: { orientation: "h", y: chart.id.startsWith("printed") ? -0.32 : LEGEND, x: 0, font: { ...FONT, size: 12 }, traceorder: "normal" },
    modebar: { bgcolor: "rgba(255,255,255,0.85)", color: "#8b8982", activecolor: "#2a2a2e" },
  };
}

/* An axis that a spike does not flatten: all curves, and bands but for their last twentieth, where that is much less. */
function rangeOf(traces) {
  const part = (values, share) => [...values].sort((a, b) => a - b)[Math.round(share * (values.length - 1))];
  const sets = traces.filter((one) => one.visible !== "legendonly").map((one) => ({ one, y: (one.y ?? []).filter((value) => value !== null) }));
  if (!sets.some(({ y }) => y.length)) return {};
  const whole = sets.flatMap(({ y }) => [Math.min(...y), Math.max(...y)]);
  const most = sets.flatMap(({ one, y }) => (one.meta ? [part(one.meta.low, 0.05), part(one.meta.high, 0.95)] : [Math.min(...y), Math.max(...y)]));
  const [low, high] = [Math.min(...most), Math.max(...most)];
  if (Math.max(...whole) - Math.min(...whole) <= 2 * (high - low)) return {};
  return { range: [low - 0.06 * (high - low), high + 0.06 * (high - low)] };
}

function line(x, y, muscle, name) {
  const style = { color: muscle.colour, width: 2.4 };
  const markers = y.length === 1;
  return { x, y, mode: markers ? "markers" : "lines", line: style, marker: { color: muscle.colour, size: 8 }, name, hovertemplate: "%{y:.4~g}" };
}

function band(x, low, high, colour, opacity, name, listed) {
  const fill = `rgba(${rgbOf(colour).map((part) => Math.round(255 * part)).join(",")},${opacity})`;
  const round = { x: [...x, ...x.toReversed()], y: [...low, ...high.toReversed()] };
  return [{ ...round, mode: "lines", line: { color: fill, width: 0 }, fill: "toself", fillcolor: fill, name, showlegend: listed, hoverinfo: "skip", meta: { x, low, high } }];
}

function nearest(values, wanted) {
  let best = 0;
  values.forEach((value, i) => {
    if (Math.abs(value - wanted) < Math.abs(values[best] - wanted)) best = i;
  });
  return best;
}
