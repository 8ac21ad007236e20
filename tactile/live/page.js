"use strict";

// The page of a model at work. Pictures come as events; only the newest is drawn, when the browser draws next.

const REPORT_MS = 100; // between two words to the server about what is drawn
const WORDS_MS = 200; // between two changes of counts and times, and of the plot below a map
const SILENT_MS = 2000; // without a line
const QUIET_MS = 1000; // without a picture, after which the last word is said again: it may have been lost
const HELD_S = 30; // a scale fits what was seen for so long, and a plot shows it
const SCALE = [1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10]; // ends of a scale, so that most colours are used
const AGAIN_MS = 5000; // until a page that was refused asks again

const element = (id) => document.getElementById(id);
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
let model = null;
let waiting = null; // text of the newest picture that is not drawn
let drawn = null; // the newest picture that was read, of which the server is told
let shown = null; // the picture on the page
let frozen = null; // when the page was frozen
let zero = null; // {at, offset}: what is taken from each value of the panel "Reading"
let running = false; // a recording is
let reported = -Infinity;
let worded = -Infinity;
let arrived = performance.now();
let state = "waiting";

// The range of the values of the last HELD_S seconds: `least` to `most`.
class Span {
  constructor() { this.seconds = new Map(); }

  add(low, high) {
    const now = Math.floor(performance.now() / 1000);
    const [least, most] = this.seconds.get(now) ?? [Infinity, -Infinity];
    this.seconds.set(now, [Math.min(least, low), Math.max(most, high)]);
    for (const second of this.seconds.keys()) if (second < now - HELD_S) this.seconds.delete(second);
    const all = [...this.seconds.values()];
    [this.least, this.most] = [Math.min(...all.map(([one]) => one)), Math.max(...all.map(([, one]) => one))];
  }
}
const spans = { reading: new Span(), prediction: new Span() };
const history = []; // [time in s, values] of a plot; a value may be null
const latest = []; // [time in ms, reading] of the last second

// The next of `steps` times a power of ten that is not below.
function round(value, steps = [1, 2, 5, 10]) {
  const power = 10 ** Math.floor(Math.log10(value));
  return steps.map((step) => step * power).find((step) => step >= value * 0.9999);
}
const short = (value) => `${Number(value.toPrecision(4))}`;
const clock = (date) => date.toTimeString().slice(0, 8);

// Room to draw in, in CSS pixels, `shape` = height / width.
function room(canvas, shape) {
  const width = canvas.clientWidth;
  const height = Math.round(width * shape);
  const dots = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * dots) || canvas.height !== Math.round(height * dots)) {
    canvas.width = Math.round(width * dots);
    canvas.height = Math.round(height * dots);
    canvas.style.height = `${height}px`;
  }
  const context = canvas.getContext("2d");
  context.setTransform(dots, 0, 0, dots, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "13px system-ui, sans-serif";
  context.fillStyle = style("--ink");
  return [context, width, height];
}

const colour = (share) => {
  const place = 3 * Math.max(0, Math.min(255, Math.round(255 * share)));
  return [model.viridis[place], model.viridis[place + 1], model.viridis[place + 2]];
};

// Cells of a map, row 0 at the lower edge, as an image of a pixel each.
function image([rows, columns], share) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [columns, rows];
  const context = canvas.getContext("2d");
  const data = context.createImageData(columns, rows);
  for (let row = 0; row < rows; row += 1) {
    for (let column = 0; column < columns; column += 1) {
      const place = 4 * ((rows - 1 - row) * columns + column);
      data.data.set([...colour(share(row * columns + column)), 255], place);
    }
  }
  context.putImageData(data, 0, 0);
  return canvas;
}

const scales = { upright: null, flat: null }; // all colours, the darkest below or on the left

function drawMap(picture) {
  const [rows, columns] = model.map;
  const [across, up] = model.size_mm;
  const left = 30, right = 64, top = 8, bottom = 36;
  const canvas = element("prediction");
  const inner = Math.max(50, canvas.clientWidth - left - right);
  const [context, width] = room(canvas, (inner * up / across + top + bottom) / canvas.clientWidth);
  const high = inner * up / across;
  const values = picture.known ? bytes(picture.map) : new Uint8Array(rows * columns);
  const peak = picture.known ? picture.peak : 0;
  const most = round(Math.max(spans.prediction.most, 4 * model.touch_kpa), SCALE);
  context.imageSmoothingEnabled = false;
  context.drawImage(image(model.map, (cell) => values[cell] / 255 * peak / most), left, top, inner, high);

  context.drawImage(scales.upright, width - right + 14, top, 14, high);
  context.textBaseline = "middle";
  for (const share of [0, 0.5, 1]) context.fillText(short(share * most), width - right + 32, top + high * (1 - share) + (share === 1 ? 6 : share ? 0 : -6));
  context.fillText("kPa", width - right + 14, top + high + 14);

  const step = round(Math.max(across, up) / 8);
  context.textAlign = "center";
  for (let mm = 0; mm <= across + 0.01; mm += step) context.fillText(`${mm}`, left + inner * mm / across, top + high + 14);
  context.fillText("mm", left + inner / 2, top + high + 29);
  context.textAlign = "right";
  for (let mm = 0; mm <= up + 0.01; mm += step) context.fillText(`${mm}`, left - 6, top + high * (1 - mm / up));
  context.textAlign = "left";

  const at = (x_mm, y_mm) => [left + inner * x_mm / across, top + high * (1 - y_mm / up)];
  const outlined = (draw) => {
    for (const [line, ink] of [[5, "#000"], [2, "#fff"]]) {
      context.beginPath();
      draw();
      [context.lineWidth, context.strokeStyle] = [line, ink];
      context.stroke();
    }
  };
  for (const tip of picture.tips ?? []) outlined(() => context.arc(...at(...tip), 15, 0, 2 * Math.PI));
  (picture.touches ?? []).forEach((touch, place) => {
    const [x, y] = at(touch.x_mm, touch.y_mm);
    outlined(() => {
      for (const [a, b] of [[8, 0], [0, 8]]) {
        context.moveTo(x - a, y - b);
        context.lineTo(x + a, y + b);
      }
    });
    const words = `${place + 1}: ${touch.kpa.toFixed(0)} kPa`;
    context.font = "bold 14px system-ui, sans-serif";
    const long = context.measureText(words).width;
    const begin = x + 20 + long < left + inner ? x + 20 : x - 20 - long;
    [context.lineWidth, context.strokeStyle, context.lineJoin] = [4, "#000", "round"];
    context.strokeText(words, begin, y);
    context.fillStyle = "#fff";
    context.fillText(words, begin, y);
  });
}

// The course of the last HELD_S seconds.
function drawPlot(canvas, shape, words = "") {
  const [context, width, height] = room(canvas, shape);
  const left = 48, right = 8, top = 8, bottom = 24;
  if (!history.length) return;
  const all = history.flatMap(([, one]) => one.filter(Number.isFinite));
  const [least, most] = [Math.min(...all), Math.max(...all)];
  const room_ = Math.max(0.1 * (most - least), 0.01);
  const end = history.at(-1)[0];
  const x = (time) => left + (width - left - right) * (1 - (end - time) / HELD_S);
  const y = (value) => top + (height - top - bottom) * (most + room_ - value) / (most - least + 2 * room_);
  context.strokeStyle = style("--line");
  context.strokeRect(left, top, width - left - right, height - top - bottom);
  context.textBaseline = "middle";
  context.textAlign = "right";
  for (const value of [least, (least + most) / 2, most]) context.fillText(value.toFixed(most - least < 5 ? 2 : 1), left - 6, y(value));
  context.textAlign = "left";
  context.fillText(`${HELD_S} s ago`, left, height - 10);
  context.textAlign = "right";
  context.fillText("now", width - right, height - 10);
  context.textAlign = "left";
  context.fillText(words, left + 6, top + 10);
  history[0][1].forEach((_, place) => {
    context.beginPath();
    for (const [time, one] of history) if (Number.isFinite(one[place])) context.lineTo(x(time), y(one[place]));
    context.strokeStyle = style(["--first", "--second", "--third"][place % 3]);
    context.setLineDash([[], [8, 4], [2, 3]][place % 3]);
    context.lineWidth = 2;
    context.stroke();
  });
  context.setLineDash([]);
}

function drawBars(picture) {
  const list = element("bars");
  while (list.children.length < model.names.length) {
    const row = document.createElement("li");
    const [name, bar, share] = ["name", "bar", "share"].map((kind) => {
      const part = document.createElement("span");
      part.className = kind;
      row.append(part);
      return part;
    });
    name.textContent = model.names[list.children.length];
    bar.append(document.createElement("span"));
    share.textContent = "–";
    list.append(row);
  }
  if (!picture.known) return;
  picture.values.forEach((value, place) => {
    const row = list.children[place];
    row.classList.toggle("likeliest", model.names[place] === picture[model.best]);
    row.querySelector(".bar span").style.width = `${100 * value}%`;
    row.querySelector(".share").textContent = `${(100 * value).toFixed(0)} %`;
  });
}

function drawReading(picture) {
  const [rows, columns] = model.reading.grid;
  const canvas = element("reading"), below = 34; // where the scale is
  const grid = canvas.clientWidth * Math.min(1, Math.max(0.15, rows / columns)) * 0.8;
  const [context, width] = room(canvas, (grid + below) / canvas.clientWidth);
  const [cell, high] = [width / columns, grid / rows];
  const { least } = spans.reading;
  const most = Math.max(spans.reading.most, least + model.reading.least_span, least + 1e-6);
  context.textAlign = "center";
  context.textBaseline = "middle";
  const bottom = model.kind !== "images"; // row 0 of an array is its bottom row
  const whole = picture.reading.every(Number.isInteger) ? (value) => `${Math.round(value)}` : null;
  zeroed(picture).forEach((value, place) => {
    const row = Math.floor(place / columns);
    const [x, y] = [(place % columns) * cell, (bottom ? rows - 1 - row : row) * high];
    const share = (value - least) / (most - least);
    context.fillStyle = `rgb(${colour(share).join(" ")})`;
    context.fillRect(x, y, cell - 1, high - 1);
    if (cell > 28 && high > 16) {
      context.fillStyle = share > 0.55 ? "#000" : "#fff";
      context.fillText(whole ? whole(value) : value.toFixed(2), x + cell / 2, y + high / 2);
    }
  });
  context.drawImage(scales.flat, 0, grid + 5, width, 10);
  context.fillStyle = style("--ink");
  for (const [side, x, value] of [["left", 0, least], ["right", width, most]]) {
    context.textAlign = side;
    context.fillText(`${(whole ?? short)(value)} ${model.reading.unit}`, x, grid + 25);
  }
}

// The values of the panel "Reading".
const zeroed = (picture) => zero ? picture.reading.map((value, place) => value - zero.offset[place]) : picture.reading;

// Note what scales, plots and the button "Zero" need of a picture.
function take(picture) {
  const now = performance.now();
  latest.push([now, picture.reading]);
  while (latest[0][0] < now - 1000) latest.shift();
  spans.reading.add(Math.min(...zeroed(picture)), Math.max(...zeroed(picture)));
  spans.prediction.add(0, picture.known ? picture.peak ?? 0 : 0);
  if (!picture.known || model.says === "classes") return;
  const values = picture.values ?? [picture.force_n, ...(model.truth ? [picture.load_cells_n ?? null] : [])];
  if (!Number.isFinite(values[0])) return;
  if (history.length && picture.t_s < history.at(-1)[0]) history.length = 0; // a new clock
  history.push([picture.t_s, values]);
  while (history[0][0] < picture.t_s - HELD_S) history.shift();
}

function draw() {
  if (waiting === null || frozen) return;
  const text = waiting;
  waiting = null; // whatever becomes of this picture, the next one is drawn
  drawn = JSON.parse(text);
  try {
    take(drawn);
    paint(drawn);
  } finally { // or no more would come
    const now = performance.now();
    if (now - reported > REPORT_MS) {
      reported = now;
      after.port2.postMessage(drawn.arrived_s); // answered once this picture is laid out and painted
    }
  }
}

// Show a picture, and in `words` what else there is to say; map and table are of one picture at any time.
function paint(picture, words = performance.now() - worded > WORDS_MS) {
  if (!shown) for (const name of ["freeze", "zero"]) element(name).disabled = false;
  shown = picture;
  if (model.touch_kpa !== null) drawMap(picture);
  else if (model.says === "classes") drawBars(picture);
  else drawPlot(element("prediction"), 0.6);
  drawReading(picture);
  say(picture);
  if (!words) return;
  worded = performance.now();
  label(picture);
  if (model.touch_kpa !== null) drawPlot(element("force"), 0.22, "Force, N");
  status(picture.status);
}
const after = new MessageChannel();
after.port1.onmessage = (message) => report(message.data);

function report(arrived_s) {
  if (drawn === null) return;
  const body = JSON.stringify({ viewer: model.viewer, number: drawn.number, arrived_s });
  fetch("drawn", { method: "POST", body }).catch(() => {}); // the stream of events says that the server is gone
}

function cells(kind, values) {
  const row = document.createElement("tr");
  row.append(...values.map((value) => {
    const cell = document.createElement(kind);
    if (kind === "th") cell.scope = "col";
    cell.textContent = value;
    return cell;
  }));
  return row;
}

// A number, or a dash in the place of one that JSON does not have.
const fixed = (value, digits) => Number.isFinite(value) ? value.toFixed(digits) : "–";

// The name of an output and its unit, of x_mm x and mm.
const apart = (output) => output.split(/_(?=[^_]+$)/);

// The interval of an output in words, such as " (1.2 to 3.4)", why there is none, or nothing.
function between(picture, output, digits) {
  if (picture.outside_training) return " (no interval: outside the training)";
  const [name, unit] = apart(output);
  const [low, high] = [picture[`${name}_low_${unit}`], picture[`${name}_high_${unit}`]];
  return low === undefined || low === null ? "" : ` (${low.toFixed(digits)} to ${high.toFixed(digits)})`;
}

// Write rows of cells into the table, of which those that stay as they are cost nothing.
function tabulate(rows) {
  const body = element("values").tBodies[0];
  while (body.rows.length > rows.length) body.deleteRow(-1);
  rows.forEach((values, place) => {
    const row = body.rows[place] ?? body.appendChild(cells("td", values));
    values.forEach((value, k) => { if (row.cells[k].textContent !== `${value}`) row.cells[k].textContent = value; });
  });
}

function say(picture) {
  const total = element("total");
  if (!picture.known) {
    total.textContent = model.lacks;
    tabulate([]);
  } else if (model.touch_kpa !== null) {
    tabulate(picture.touches.map((touch, place) =>
      [place + 1, touch.x_mm.toFixed(1), touch.y_mm.toFixed(1), touch.kpa.toFixed(0)]));
    total.textContent = `${picture.touches.length || "No"} touch${picture.touches.length === 1 ? "" : "es"}; force ${fixed(picture.force_n, 1)} N${between(picture, "force_n", 1)}`;
    if ("load_cells_n" in picture) total.textContent += `, on the load cells ${fixed(picture.load_cells_n, 1)} N`;
    const peak = between(picture, "peak_kpa", 0);
    if (peak && !picture.outside_training) total.textContent += `; peak ${picture.peak.toFixed(0)} kPa${peak}`;
  } else if (model.says === "classes") {
    total.textContent = `Most likely: ${picture[model.best]}`;
    if (picture.outside_training) total.textContent += "; no set: outside the training";
    else if (picture[model.set]) total.textContent += `; the 90 % set: ${picture[model.set].join(", ")}`;
  } else {
    const values = picture.values ?? [picture.force_n];
    const names = model.names ?? ["force_n"];
    tabulate(values.map((value, place) =>
      [`${apart(names[place])[0]} (${["line", "dashes", "dots"][place % 3]})`, fixed(value, 2) + between(picture, names[place], 2)]));
  }
}

// Tell in words what the canvases show.
function label(picture) {
  if (picture.known && model.touch_kpa !== null) {
    element("prediction").setAttribute("aria-label", `Pressure map: ${picture.touches.map((touch) =>
      `${touch.kpa.toFixed(0)} kPa at ${touch.x_mm.toFixed(0)}, ${touch.y_mm.toFixed(0)} mm`).join("; ") || "no touch"}`);
    element("force").setAttribute("aria-label", `Plot of the force of the last ${HELD_S} s, now ${fixed(picture.force_n, 1)} N`);
  } else if (picture.known && model.says !== "classes") {
    const values = picture.values ?? [picture.force_n], names = model.names ?? ["force_n"];
    element("prediction").setAttribute("aria-label", `Plot of the last ${HELD_S} s: ${values.map((value, place) =>
      `${apart(names[place]).join(" in ")} ${fixed(value, 2)}`).join(", ")}`);
  }
  const values = zeroed(picture);
  element("reading").setAttribute("aria-label",
    `${zero ? "Change of the reading" : "Reading"}: ${values.length} values from ${short(Math.min(...values))} to ${short(Math.max(...values))} ${model.reading.unit}`);
}

function status(one) {
  const times = (pair) => pair ? `${pair[0].toFixed(1)} ms; 95 % within ${pair[1].toFixed(1)} ms` : "–";
  element("rate").textContent = one.lines_per_s.toFixed(one.lines_per_s < 10 ? 1 : 0);
  element("lines").textContent = one.lines;
  const reasons = Object.entries(one.rejects);
  const count = reasons.reduce((sum, [, number]) => sum + number, 0);
  element("rejects").textContent = count
    ? `${count}: ${reasons.map(([reason, number]) => `${reason} ${number}`).join(", ")}` : "0";
  element("rejected").hidden = !count;
  element("rejected").textContent = `Last rejected: ${one.rejected || "(empty)"}`;
  element("to-prediction").textContent = times(one.to_prediction_ms);
  element("to-picture").textContent = times(one.to_picture_ms);
  recording(one.recording);
  const notes = element("notes");
  if (notes.children.length !== one.notes.length) {
    notes.replaceChildren(...one.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
    notes.hidden = !one.notes.length;
  }
}

// The log that the button "Record" started: in the list how long it is, above it, which a reader hears, that it is.
function recording(one) {
  if (!one) return;
  running = one.runs;
  element("record").setAttribute("aria-pressed", running);
  element("recording").textContent = one.file ? `${one.lines} lines in ${one.file}${running ? "" : ", ended"}` : "none";
  const words = one.problem ? `Not recorded: ${one.problem}.` : running ? `Recording each line as it comes to ${one.file}.` : "";
  if (element("recorded").textContent !== words) element("recorded").textContent = words;
}

function freeze(date) {
  frozen = date;
  element("freeze").setAttribute("aria-pressed", Boolean(frozen));
  element("save").disabled = !frozen;
  element("frozen").textContent = frozen ? `Frozen at ${clock(frozen)}; the session goes on.` : "";
  if (frozen) paint(shown, true); // all of it of one picture
  else if (waiting !== null) draw();
  else if (drawn) paint(drawn, true);
}

function setZero(one) {
  zero = one;
  spans.reading = new Span();
  element("zero").setAttribute("aria-pressed", Boolean(zero));
  element("zeroed").textContent = zero ?
    `Zero at ${clock(zero.at)}: the panel Reading shows what has changed from the mean of the second before. ` +
    "Predictions, here as in CSV and datagrams, are of the readings as they come, because the model knows the rest level " +
    "of its training alone. Recordings hold the lines as they come. Press Zero again to see the readings." : "";
  if (!shown) return;
  spans.reading.add(Math.min(...zeroed(shown)), Math.max(...zeroed(shown)));
  paint(shown, true);
}

// Save what is frozen as a picture: the canvases, or bars, where they are on the page, below name and time.
function save() {
  const canvases = [...document.querySelectorAll("canvas")].filter((canvas) => canvas.clientWidth);
  const words = [...document.querySelectorAll("h2:has(~ canvas), #bars .name, #bars .share")];
  const places = [...canvases, ...words].map((part) => part.getBoundingClientRect()).filter((place) => place.width);
  const [left, top] = [Math.min(...places.map((place) => place.left)) - 12, Math.min(...places.map((place) => place.top)) - 56];
  const [right, bottom] = [Math.max(...places.map((place) => place.right)) + 12, Math.max(...places.map((place) => place.bottom)) + 12];
  const picture = document.createElement("canvas"), dots = window.devicePixelRatio || 1;
  [picture.width, picture.height] = [(right - left) * dots, (bottom - top) * dots];
  const context = picture.getContext("2d");
  context.scale(dots, dots);
  context.fillStyle = style("--paper");
  context.fillRect(0, 0, right - left, bottom - top);
  context.fillStyle = style("--ink");
  context.textBaseline = "top";
  context.font = "bold 16px system-ui, sans-serif";
  context.fillText(model.name, 12, 10);
  context.font = "14px system-ui, sans-serif";
  context.fillText(`${frozen.toLocaleString("sv")}; ${shown.t_s ?? "–"} s on the sensor's clock${zero ? `; reading from zero at ${clock(zero.at)}` : ""}`, 12, 31);
  for (const part of words) {
    const place = part.getBoundingClientRect();
    if (place.width) context.fillText(part.textContent, place.left - left, place.top - top);
  }
  for (const canvas of canvases) {
    const place = canvas.getBoundingClientRect();
    context.drawImage(canvas, place.left - left, place.top - top, place.width, place.height);
  }
  picture.toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `${model.name}_${frozen.toLocaleString("sv")}.png`.replace(/[^\w.]+/g, "_");
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

element("freeze").onclick = () => freeze(frozen ? null : new Date());
element("save").onclick = save;
element("zero").onclick = () => setZero(zero ? null : {
  at: new Date(),
  offset: shown.reading.map((_, place) => latest.reduce((sum, [, reading]) => sum + reading[place], 0) / latest.length),
});
element("record").onclick = () =>
  fetch("record", { method: "POST", body: JSON.stringify({ viewer: model.viewer, record: !running }) })
    .then((answer) => answer.json()).then(recording).catch(() => {}); // the stream of events says that the server is gone
addEventListener("resize", () => shown && paint(shown, true));

function show(name, words) {
  state = name;
  const place = element("state");
  if (place.textContent !== words) [place.textContent, place.dataset.state] = [words, name];
}

function listen() {
  const events = new EventSource("pictures");
  events.addEventListener("model", (event) => {
    model = JSON.parse(event.data);
    drawn = waiting = shown = null; // a word is of the pictures of this connection
    model.viridis = bytes(model.viridis);
    scales.upright = image([64, 1], (place) => place / 63);
    scales.flat = image([1, 64], (place) => place / 63);
    if (frozen) freeze(null);
    setZero(null);
    history.length = latest.length = 0;
    element("record").disabled = !model.records;
    if (!model.records) element("recording").textContent = "a replayed log is a file already";
    document.title = `${model.name} live`;
    element("name").textContent = model.name;
    element("prediction-title").textContent = model.heading;
    element("bars").hidden = model.says !== "classes";
    element("prediction").hidden = model.says === "classes";
    element("values").hidden = model.says === "classes";
    element("force").hidden = model.touch_kpa === null;
    element("reading-scale").textContent = `${model.reading.values} values; colours span those of the last ${HELD_S} s`;
    element("intervals").textContent = model.intervals.join(". ");
    element("values-title").textContent = model.touch_kpa !== null ? "Touches" : "Values";
    if (model.touch_kpa !== null) {
      element("values").tHead.replaceChildren(cells("th", ["touch", "x, mm", "y, mm", "kPa"]));
      element("prediction-scale").textContent =
        `From the lower left corner; a cross is a touch that is found, a peak of at least ${model.touch_kpa.toFixed(0)} kPa` +
        `${model.truth ? "; a ring is a tip that pressed, by the log of its place" : ""}. Yellow is the highest of the last ${HELD_S} s, rounded up`;
      element("force-scale").textContent = `Force in N: of the map as a line${model.truth ? ", on the load cells as dashes" : ""}`;
    } else if (model.says !== "classes") {
      element("values").tHead.replaceChildren(cells("th", ["output", model.unit]));
    }
    show("waiting", "waiting for lines");
  });
  events.addEventListener("picture", (event) => {
    if (waiting === null) requestAnimationFrame(draw);
    waiting = event.data;
    arrived = performance.now();
    if (state !== "live") show("live", "live");
  });
  events.addEventListener("status", (event) => status(JSON.parse(event.data).status)); // no line came since
  events.addEventListener("end", (event) => {
    events.close();
    draw();
    if (shown) paint(shown, true);
    status(JSON.parse(event.data).status);
    show("ended", "ended");
  });
  events.onerror = () => {
    if (state === "ended") return;
    show("lost", "no connection to `tactile live`");
    if (events.readyState !== EventSource.CLOSED) return; // the browser asks again by itself, unless it was refused
    show("lost", "`tactile live` refuses this page: too many may be open; close others, it tries again");
    setTimeout(listen, AGAIN_MS);
  };
}
listen();

setInterval(() => {
  const silent = performance.now() - arrived;
  if (state === "live" && silent > SILENT_MS) show("waiting", "no line for some seconds");
  if (waiting !== null && (document.hidden || frozen)) { // nothing is drawn, but what comes must not pile up
    drawn = JSON.parse(waiting);
    waiting = null;
    status(drawn.status);
    report(null);
  } else if (drawn !== null && state !== "ended" && silent > QUIET_MS) {
    report(null);
  }
}, 1000);
