/* What is taken away from a page. */

function save(address, name) {
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  link.click();
}

/* What a chart shows, as numbers: a row for each point of a curve, and for each place of a band. */
function csvOf(chart) {
  const cell = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const labels = [chart.labels.x, chart.labels.y].map((words) => cell(words.replaceAll("\n", " ")));
  const rows = [["series", ...labels, "low", "high"].join(",")];
  for (const trace of chart.data.filter((one) => one.visible !== false)) {
    const { x, low, high } = trace.meta ?? { x: trace.x };
    x.forEach((at, i) => rows.push([cell(trace.name), at, low ? "" : trace.y[i], low?.[i] ?? "", high?.[i] ?? ""].join(",")));
  }
  return `${rows.join("\n")}\n`;
}

function saveButtons() {
  const saved = (type, of) => (event) => {
    const chart = document.getElementById(event.target.dataset.chart);
    save(URL.createObjectURL(new Blob([of(chart)], { type })), `${chart.id}.${event.target.textContent.toLowerCase()}`);
  };
  const drawing = (chart) => new XMLSerializer().serializeToString(chart.querySelector("svg"));
  for (const button of document.querySelectorAll("[data-chart]")) {
    button.addEventListener("click", button.textContent === "CSV" ? saved("text/csv", csvOf) : saved("image/svg+xml", drawing));
  }
}
