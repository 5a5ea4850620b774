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
// Sections unfold for a link into them, for the button, and for printing; after printing they are as they were.
const sections = [...document.querySelectorAll("details")];
function unfoldTarget() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target) return;
  for (let each = target; each; each = each.parentElement) if (each.tagName === "DETAILS") each.open = true;
  target.scrollIntoView();
}
const button = document.getElementById("unfold");
button.hidden = false;
button.addEventListener("click", () => {
  const open = sections.some((each) => !each.open);
  for (const each of sections) each.open = open;
  button.textContent = open ? "Fold all sections" : "Unfold all sections";
});
let folded = [];
addEventListener("beforeprint", () => {
  folded = sections.filter((each) => !each.open);
  for (const each of folded) each.open = true;
});
addEventListener("afterprint", () => { for (const each of folded) each.open = false; });
addEventListener("hashchange", unfoldTarget);
unfoldTarget();
document.documentElement.dataset.ready = "true";
