/* Curves over the motion: lengths, moment arms, and how the shape was kept. */

function makeCurves(data, block, choose) {
  const known = Object.fromEntries(data.muscles.map((muscle) => [muscle.name, muscle]));
  const state = { muscle: data.muscles.length > 1 ? "" : (data.muscles[0]?.name ?? ""), coordinate: data.coordinates[0]?.name, check: (data.checks.find((one) => !one.flat) ?? data.checks[0])?.key, at: 0 };
  const charts = ["lengths", "fibre-lengths", "arms", "checks"].map((id) => document.getElementById(id)).filter(Boolean);
  saveButtons();

  function chosen() {
    return state.muscle ? [known[state.muscle]] : data.muscles;
  }

  function lengths(id, key, what, label) {
    const single = Boolean(state.muscle);
    const traces = chosen().flatMap((muscle) => {
      if (!muscle[key]) return [];
      const { mean, low, high, lower, upper, held } = muscle[key];
      const times = data.times.slice(0, mean.length);
      const bands = [band(times, low, high, muscle.colour, single ? 0.16 : 0.1, `${muscle.label}: all ${what}`, single)];
      if (single) {
        bands.push(band(times, lower, upper, muscle.colour, 0.28, `middle half of the ${what}`, true));
        if (held[0].some(Number.isFinite)) bands.push(band(times, ...held, ERROR, 0.4, "error of the mean change since rest (95 %)", true));
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
    return [{ x, y, colour: muscle.colour, width: 0.6, opacity: 0.45, name: `${drawn} single ${what}`, visible: false }];
  }

  function arms(id = "arms", named = state.coordinate) {
    const single = Boolean(state.muscle);
    const coordinate = data.coordinates.find((one) => one.name === named);
    if (!coordinate) return;
    const traces = chosen().flatMap((muscle) => {
      const found = muscle.arms?.[named];
      if (!found) return [];
      const { values, mean, low, high, quartic, held } = found;
      const parts = [band(values, low, high, muscle.colour, single ? 0.16 : 0.1, `${muscle.label}: all paths`, single)];
      if (single) {
        if (held[0].some(Number.isFinite)) parts.push(band(values, ...held, ERROR, 0.4, "error of the mean (95 %)", true));
        if (quartic) parts.push({ x: values, y: quartic, colour: "#2a2a2e", width: 1.2, dash: "dash", name: "quartic fit" });
        parts.push(...(found.literature || []).flatMap(published));
      }
      return [...parts.flat(), line(values, mean, muscle, single ? "mean of the paths" : muscle.label)];
    });
    const note = coordinate.positive ? `positive: ${coordinate.positive}` : "";
    paint(id, traces, coordinate.axis, `moment arm [${coordinate.of}]`, note);
  }

  function published(curve) {
    if (curve.low) return band(curve.x, curve.low, curve.high, curve.colour, 0.25, curve.label, true);
    const mode = curve.x.length === 1 ? "markers" : "lines";
    return [{ x: curve.x, y: curve.y, mode, colour: curve.colour, width: 1.8, dash: "dot", name: curve.label, told: true }];
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
      const sides = [data.times[0], data.times.at(-1)];
      traces.push({ x: sides, y: [limit, limit], colour, width: 1.2, dash: "dash", name: `limit: ${name}` });
    }
    paint(id, traces, data.timeLabel, check.label.replace(/(.{18}\S*) /g, "$1\n"));
  }

  function paint(id, traces, x, y, note = "") {
    const chart = document.getElementById(id);
    if (chart) drawChart(chart, traces, { x, y, note }, cursor(id), (at) => choose(nearest(id === "arms" ? coordinateValues() : data.times, at)));
  }

  function coordinateValues() {
    return data.coordinates.find((one) => one.name === state.coordinate)?.values ?? data.times;
  }

  function cursor(id) {
    return id === "arms" ? coordinateValues()[state.at] : data.times[state.at];
  }

  /* Charts of the coordinates and checks that are not chosen, for paper; gone after that. */
  function print(begin) {
    for (const chart of charts) {
      if (!chart.hidden) render(chart, ...(begin ? [PAPER, TALL] : []));
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
      make(id);
    };
    for (const one of data.coordinates) if (one.name !== state.coordinate) more("arms", `Moment arms by ${one.label}`, (id) => arms(id, one.name));
    for (const one of data.checks) if (one.key !== state.check && !one.flat) more("checks", one.label, (id) => checks(id, one.key));
  }

  let waiting = false;
  function move() {
    waiting = false;
    for (const chart of charts) if (chart.data) moveCursor(chart, cursor(chart.id));
  }

  function all() {
    lengths("lengths", "lengths", "paths", "length, bone to bone [mm]");
    lengths("fibre-lengths", "fibreLengths", "fibres", "fibre length [mm]");
    arms();
    checks();
  }

  return {
    state,
    draw: all,
    print,
    set(changes) {
      Object.assign(state, changes);
      all();
    },
    show(position) {
      state.at = position;
      if (!waiting) requestAnimationFrame(move);
      waiting = true;
    },
  };
}

/* Colour of the error of a mean. */
const ERROR = "#6b6b75";

/* Width and height of a chart on paper [px], within the margins of A4. */
const [PAPER, TALL] = [670, 320];

function line(x, y, muscle, name) {
  return { x, y, mode: y.length === 1 ? "markers" : "lines", colour: muscle.colour, width: 2.4, name, told: true };
}

function band(x, low, high, colour, opacity, name, listed) {
  return [{ x, colour, opacity, name, listed, meta: { x, low, high } }];
}

function nearest(values, wanted) {
  let best = 0;
  values.forEach((value, i) => {
    if (Math.abs(value - wanted) < Math.abs(values[best] - wanted)) best = i;
  });
  return best;
}
