"use strict";
// A click or Enter on a heading sorts the table; a second one reverses the order.  Rows without a value go last.
function sortBy(header) {
  const table = header.closest("table");
  const body = table.tBodies[0];
  const column = header.cellIndex;
  const descending = header.getAttribute("aria-sort") === "ascending";
  const key = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent.trim();
  const numeric = [...body.rows].every((row) => key(row) === "" || !Number.isNaN(Number(key(row))));
  const rows = [...body.rows].sort((a, b) => {
    const [x, y] = [key(a), key(b)];
    if (x === "" || y === "") return (x === "") - (y === "");
    const order = numeric ? Number(x) - Number(y) : x.localeCompare(y);
    return descending ? -order : order;
  });
  for (const other of table.tHead.querySelectorAll("th")) other.removeAttribute("aria-sort");
  header.setAttribute("aria-sort", descending ? "descending" : "ascending");
  body.append(...rows);
}
for (const header of document.querySelectorAll("table.sortable thead th")) {
  header.tabIndex = 0;
  header.title = "Sort by this column";
  header.addEventListener("click", () => sortBy(header));
  header.addEventListener("keydown", (event) => { if (event.key === "Enter") sortBy(header); });
}
// Figures take their colours from the style sheet, so that they follow dark mode and print.
const figures = Object.entries(JSON.parse(document.getElementById("figures").textContent));
function paint(width) {
  const style = getComputedStyle(document.documentElement);
  const [ink, line] = ["--ink", "--line"].map((name) => style.getPropertyValue(name).trim());
  for (const [id, figure] of figures) {
    const { xaxis, yaxis, ...rest } = figure.layout;
    const colour = (axis) => ({ ...axis, gridcolor: line, zerolinecolor: line });
    const layout = { ...rest, xaxis: colour(xaxis), yaxis: colour(yaxis), font: { ...rest.font, color: ink } };
    const data = figure.data.map((one) => (one.line?.color === "ink" ? { ...one, line: { ...one.line, color: ink } } : one));
    if (width) Object.assign(layout, { width, autosize: false });
    Plotly.react(id, data, layout, { responsive: true, displayModeBar: false });
  }
}
paint();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => paint());
// 186 mm, the width between the margins of A4
window.addEventListener("beforeprint", () => paint(690));
window.addEventListener("afterprint", () => paint());
document.documentElement.dataset.ready = "true";
