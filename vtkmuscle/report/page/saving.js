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
  const label = (axis) => cell(chart.layout[axis].title.text.replace(/<br><sup>.*/, "").replaceAll("<br>", " "));
  const rows = [["series", label("xaxis"), label("yaxis"), "low", "high"].join(",")];
  for (const trace of chart.data.filter((one) => one.visible !== "legendonly")) {
    const { x, low, high } = trace.meta ?? { x: trace.x };
    x.forEach((at, i) => rows.push([cell(trace.name), at, low ? "" : trace.y[i], low?.[i] ?? "", high?.[i] ?? ""].join(",")));
  }
  return `${rows.join("\n")}\n`;
}

function csvButtons() {
  for (const button of document.querySelectorAll("[data-csv]")) {
    const chart = document.getElementById(button.dataset.csv);
    button.addEventListener("click", () => save(URL.createObjectURL(new Blob([csvOf(chart)], { type: "text/csv" })), `${chart.id}.csv`));
  }
}
