"use strict";

// A cell's value: the number that it starts with, else its words.
function value(cell) {
  const text = cell.dataset.value ?? cell.textContent.trim().replaceAll(",", "");
  const found = text.match(/^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?/i);
  return found ? Number(found[0]) : text.toLowerCase();
}

// Numbers in order, then words in order; what is empty, a dash or NaN stays last in both directions, and totals below.
function sort(table, column, ascending) {
  const body = table.tBodies[0];
  const rows = [...body.rows].filter((row) => !row.classList.contains("total")).map((row) => [value(row.cells[column]), row]);
  const missing = (one) => one === "" || one === "-" || one === "nan";
  const numbers = rows.filter(([one]) => typeof one === "number").length;
  const mostly = numbers * 2 >= rows.filter(([one]) => !missing(one)).length && numbers > 0;
  const place = (one) => (missing(one) ? 2 : mostly && typeof one !== "number" ? 1 : 0);
  rows.sort(([a], [b]) => {
    if (place(a) !== place(b)) return place(a) - place(b);
    const order = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en");
    return ascending ? order : -order;
  });
  body.prepend(...rows.map(([, row]) => row));
}

for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const ascending = head.getAttribute("aria-sort") !== "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", ascending ? "ascending" : "descending");
      sort(table, column, ascending);
    });
  });
}

for (const form of document.querySelectorAll(".filters")) {
  const rows = [...form.nextElementSibling.querySelectorAll("tbody tr")];
  const show = () => {
    const { words, ...wanted } = Object.fromEntries(new FormData(form));
    for (const row of rows) {
      const fits = Object.entries(wanted).every(([name, one]) => !one || row.dataset[name] === one);
      row.hidden = !(fits && row.textContent.toLowerCase().includes(words.trim().toLowerCase()));
    }
    form.querySelector("output").textContent =
      `${rows.filter((row) => !row.hidden).length} of ${rows.length} claims`;
  };
  form.hidden = false;
  form.addEventListener("input", show);
  form.addEventListener("submit", (event) => event.preventDefault());
  show(); // a browser may have kept the choices of the last visit
}

for (const charts of document.querySelectorAll(".charts")) {
  const readout = charts.querySelector(".readout");
  const light = (model) => {
    for (const one of charts.querySelectorAll("[data-model]")) one.classList.toggle("lit", one.dataset.model === model);
    for (const one of charts.querySelectorAll(".chart")) one.classList.toggle("chosen", model !== null);
  };
  for (const point of charts.querySelectorAll(".point")) {
    point.querySelector("title").remove(); // the row is shown above the charts instead
    const show = () => {
      readout.textContent = point.getAttribute("aria-label");
      light(point.dataset.model);
    };
    point.addEventListener("pointerenter", show);
    point.addEventListener("click", show);
    point.addEventListener("focus", show);
    point.addEventListener("pointerleave", () => light(null));
    point.addEventListener("blur", () => light(null));
  }
}

// What a link leads to may lie in a part that is closed.
function reveal() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target) return;
  for (let part = target.closest("details"); part; part = part.parentElement.closest("details")) part.open = true;
  target.scrollIntoView();
}
addEventListener("hashchange", reveal);
reveal();

// On paper everything is open.
let closed = [];
addEventListener("beforeprint", () => {
  closed = [...document.querySelectorAll("details:not([open])")];
  closed.forEach((part) => (part.open = true));
});
addEventListener("afterprint", () => closed.forEach((part) => (part.open = false)));
