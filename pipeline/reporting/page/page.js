"use strict";

// A cell's value: the number that it starts with, that of `> 16` too, else its words.
function value(cell) {
  const text = cell.textContent.trim().replaceAll(",", "");
  const number = text.match(/^(?:[<>] )?([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)/i);
  return number ? Number(number[1]) : text.toLowerCase();
}

// Numbers in order, then words in order; what is empty, a dash or NaN stays last in both directions, and totals below.
function sort(table, column, ascending) {
  const body = table.tBodies[0];
  const rows = [...body.rows].filter((row) => !row.classList.contains("total")).map((row) => [value(row.cells[column]), row]);
  const missing = (key) => key === "" || key === "-" || key === "nan";
  const numbers = rows.filter(([key]) => typeof key === "number").length;
  const mostly = numbers * 2 >= rows.filter(([key]) => !missing(key)).length && numbers > 0;
  const place = (key) => (missing(key) ? 2 : mostly && typeof key !== "number" ? 1 : 0);
  rows.sort(([a], [b]) => {
    if (place(a) !== place(b)) return place(a) - place(b);
    const order = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en");
    return ascending ? order : -order;
  });
  body.prepend(...rows.map(([, row]) => row));
}

// A third click on a heading brings back the order in which the paper, or the report, has the rows.
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  const order = [...table.tBodies[0].rows];
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const before = head.getAttribute("aria-sort");
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      if (before === "descending") {
        table.tBodies[0].append(...order);
        return;
      }
      head.setAttribute("aria-sort", before ? "descending" : "ascending");
      sort(table, column, !before);
    });
  });
}

function download(name, rows) {
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const text = rows.map((row) => [...row.cells].map((cell) => quoted(cell.textContent.trim())).join(",")).join("\n");
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([`${text}\n`], { type: "text/csv" }));
  link.download = `${name}.csv`;
  link.click();
  URL.revokeObjectURL(link.href);
}

// The claims: the choices stand in the address, so that a list can be passed on.
for (const form of document.querySelectorAll(".filters")) {
  const table = form.nextElementSibling.querySelector("table");
  const rows = [...table.tBodies[0].rows];
  const nothing = form.parentElement.querySelector(".nothing");
  const show = () => {
    const { words, ...wanted } = Object.fromEntries(new FormData(form));
    for (const row of rows) {
      const fits = Object.entries(wanted).every(([name, key]) => !key || row.dataset[name] === key);
      row.hidden = !(fits && row.textContent.toLowerCase().includes(words.trim().toLowerCase()));
    }
    const shown = rows.filter((row) => !row.hidden).length;
    form.querySelector("output").textContent = `${shown} of ${rows.length} claims`;
    nothing.hidden = shown > 0;
  };
  const fromAddress = () => {
    const [place, asked] = location.hash.slice(1).split("?");
    if (place !== "claims" || asked === undefined) return;
    const choices = new URLSearchParams(asked);
    for (const field of form.elements) if (field.name) field.value = choices.get(field.name) ?? "";
    show();
  };
  form.hidden = false;
  form.addEventListener("input", () => {
    show();
    const choices = [...new FormData(form)].filter(([, key]) => key);
    history.replaceState(null, "", choices.length ? `#claims?${new URLSearchParams(choices)}` : "#claims");
  });
  form.addEventListener("submit", (event) => event.preventDefault());
  form.querySelector(".download").addEventListener("click", () => download("claims", [table.tHead.rows[0], ...rows.filter((row) => !row.hidden)]));
  addEventListener("hashchange", fromAddress);
  show(); // a browser may have kept the choices of the last visit
  fromAddress();
}

// What a link leads to may lie in a part that is closed.
function reveal() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1).split("?")[0]));
  if (!target) return;
  for (let part = target.closest("details"); part; part = part.parentElement.closest("details")) part.open = true;
  target.scrollIntoView();
}
addEventListener("hashchange", reveal);
reveal();

// A figure in full size, closed with Escape; with a modifier key the link opens as ever.
const lightbox = document.querySelector(".lightbox");
for (const link of document.querySelectorAll("a.picture")) {
  link.addEventListener("click", (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    const image = lightbox.querySelector("img");
    image.src = link.href;
    image.alt = link.querySelector("img").alt;
    lightbox.showModal();
  });
}
lightbox.addEventListener("click", (event) => event.target === lightbox && lightbox.close());

// The side navigation marks the section that is read.
const links = new Map([...document.querySelectorAll("nav a[href^='#']")].map((link) => [link.hash.slice(1), link]));
const seen = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    if (!entry.isIntersecting) continue;
    for (const link of links.values()) link.removeAttribute("aria-current");
    links.get(entry.target.id)?.setAttribute("aria-current", "true");
  }
}, { rootMargin: "-10% 0px -80% 0px" });
for (const key of links.keys()) seen.observe(document.getElementById(key));

// On paper everything is open.
let closed = [];
addEventListener("beforeprint", () => {
  closed = [...document.querySelectorAll("details:not([open])")];
  closed.forEach((part) => (part.open = true));
});
addEventListener("afterprint", () => closed.forEach((part) => (part.open = false)));
