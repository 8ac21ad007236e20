"use strict";

// The page of a model at work. Pictures come as events; only the newest is drawn, when the browser draws next.

const REPORT_MS = 100; // between two words to the server about what is drawn
const WORDS_MS = 200; // between two changes of numbers, which nobody reads faster
const SILENT_MS = 2000; // without a line
const QUIET_MS = 1000; // without a picture, after which the last word is said again: it may have been lost
const HELD_S = 30; // a scale fits what was seen for so long, and a plot shows it
const AGAIN_MS = 5000; // until a page that was refused asks again

const element = (id) => document.getElementById(id);
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
let model = null;
let waiting = null; // text of the newest picture that is not drawn
let drawn = null;
let reported = -Infinity;
let worded = -Infinity;
let arrived = performance.now();
let state = "waiting";

// The range of the values of the last HELD_S seconds.
class Span {
  constructor() { this.seconds = new Map(); }

  add(low, high) {
    const now = Math.floor(performance.now() / 1000);
    const [least, most] = this.seconds.get(now) ?? [Infinity, -Infinity];
    this.seconds.set(now, [Math.min(least, low), Math.max(most, high)]);
    for (const second of this.seconds.keys()) if (second < now - HELD_S) this.seconds.delete(second);
    const all = [...this.seconds.values()];
    return [Math.min(...all.map(([one]) => one)), Math.max(...all.map(([, one]) => one))];
  }
}
const spans = { reading: new Span(), prediction: new Span() };
const history = []; // [time in s, values] of a plot

// The next number of 1, 2, 5, 10, ... that is not below.
function round(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * 0.9999);
}

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
  const most = round(Math.max(spans.prediction.add(0, peak)[1], 4 * model.touch_kpa));
  context.imageSmoothingEnabled = false;
  context.drawImage(image(model.map, (cell) => values[cell] / 255 * peak / most), left, top, inner, high);

  const bar = image([64, 1], (cell) => cell / 63);
  context.drawImage(bar, width - right + 14, top, 14, high);
  context.textBaseline = "middle";
  for (const share of [0, 0.5, 1]) context.fillText(`${share * most}`, width - right + 32, top + high * (1 - share) + (share === 1 ? 6 : share ? 0 : -6));
  context.fillText("kPa", width - right + 14, top + high + 14);

  const step = round(Math.max(across, up) / 8);
  context.textAlign = "center";
  for (let mm = 0; mm <= across + 0.01; mm += step) context.fillText(`${mm}`, left + inner * mm / across, top + high + 14);
  context.fillText("mm", left + inner / 2, top + high + 29);
  context.textAlign = "right";
  for (let mm = 0; mm <= up + 0.01; mm += step) context.fillText(`${mm}`, left - 6, top + high * (1 - mm / up));
  context.textAlign = "left";

  (picture.touches ?? []).forEach((touch, place) => {
    const [x, y] = [left + inner * touch.x_mm / across, top + high * (1 - touch.y_mm / up)];
    for (const [line, ink] of [[5, "#000"], [2, "#fff"]]) {
      context.beginPath();
      context.arc(x, y, 15, 0, 2 * Math.PI);
      [context.lineWidth, context.strokeStyle] = [line, ink];
      context.stroke();
    }
    const words = `${place + 1}: ${touch.kpa.toFixed(0)} kPa`;
    context.font = "bold 14px system-ui, sans-serif";
    const long = context.measureText(words).width;
    const at = x + 20 + long < left + inner ? x + 20 : x - 20 - long;
    [context.lineWidth, context.strokeStyle, context.lineJoin] = [4, "#000", "round"];
    context.strokeText(words, at, y);
    context.fillStyle = "#fff";
    context.fillText(words, at, y);
  });
}

function drawPlot(picture) {
  const [context, width, height] = room(element("prediction"), 0.6);
  const left = 48, right = 8, top = 8, bottom = 24;
  const values = picture.known ? picture.values ?? [picture.force_n] : null;
  if (values?.every(Number.isFinite)) history.push([picture.t_s, values]);
  if (history.length > 1 && history.at(-1)[0] < history.at(-2)[0]) history.splice(0, history.length - 1); // a new clock
  while (history.length && history[0][0] < history.at(-1)[0] - HELD_S) history.shift();
  if (!history.length) return;
  const all = history.flatMap(([, one]) => one);
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
  history[0][1].forEach((_, place) => {
    context.beginPath();
    for (const [time, one] of history) context.lineTo(x(time), y(one[place]));
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
    row.classList.toggle("likeliest", model.names[place] === picture.object);
    row.querySelector(".bar span").style.width = `${100 * value}%`;
    row.querySelector(".share").textContent = `${(100 * value).toFixed(0)} %`;
  });
}

function drawReading(picture) {
  const [rows, columns] = model.reading.grid;
  const [context, width, height] = room(element("reading"), Math.min(1, Math.max(0.15, rows / columns)) * 0.8);
  const [cell, high] = [width / columns, height / rows];
  let [least, most] = spans.reading.add(Math.min(...picture.reading), Math.max(...picture.reading));
  most = Math.max(most, least + model.reading.least_span, least + 1e-6);
  context.textAlign = "center";
  context.textBaseline = "middle";
  const bottom = model.kind !== "images"; // row 0 of an array is its bottom row
  picture.reading.forEach((value, place) => {
    const row = Math.floor(place / columns);
    const [x, y] = [(place % columns) * cell, (bottom ? rows - 1 - row : row) * high];
    const share = (value - least) / (most - least);
    context.fillStyle = `rgb(${colour(share).join(" ")})`;
    context.fillRect(x, y, cell - 1, high - 1);
    if (cell > 28 && high > 16) {
      context.fillStyle = share > 0.55 ? "#000" : "#fff";
      context.fillText(Number.isInteger(value) ? `${value}` : value.toFixed(2), x + cell / 2, y + high / 2);
    }
  });
  element("reading-scale").textContent =
    `${picture.reading.length} values in ${model.reading.unit}; dark ${Number(least.toPrecision(4))}, yellow ${Number(most.toPrecision(4))}`;
}

function draw() {
  if (waiting === null) return;
  const text = waiting;
  waiting = null; // whatever becomes of this picture, the next one is drawn
  drawn = JSON.parse(text);
  try {
    paint(drawn);
  } finally { // or no more would come
    const now = performance.now();
    if (now - reported > REPORT_MS) {
      reported = now;
      after.port2.postMessage(drawn.arrived_s); // answered once this picture is laid out and painted
    }
  }
}

function paint(picture) {
  if (model.touch_kpa !== null) drawMap(picture);
  else if (model.kind === "images") drawBars(picture);
  else drawPlot(picture);
  drawReading(picture);
  const now = performance.now();
  if (now - worded > WORDS_MS) {
    worded = now;
    say(picture);
  }
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

// The interval of an output in words, such as " (1.2 to 3.4)", why there is none, or nothing.
function between(picture, output, digits) {
  if (picture.outside_training) return " (no interval: outside the training)";
  const [name, unit] = output.split(/_(?=[^_]+$)/);
  const [low, high] = [picture[`${name}_low_${unit}`], picture[`${name}_high_${unit}`]];
  return low === undefined || low === null ? "" : ` (${low.toFixed(digits)} to ${high.toFixed(digits)})`;
}

function say(picture) {
  const body = element("values").tBodies[0];
  const total = element("total");
  if (!picture.known) {
    total.textContent = model.kind === "images" ?
      "This reading makes no image." : "No prediction yet: the model must see a whole window without a gap.";
    body.replaceChildren();
  } else if (model.touch_kpa !== null) {
    body.replaceChildren(...picture.touches.map((touch, place) =>
      cells("td", [place + 1, touch.x_mm.toFixed(1), touch.y_mm.toFixed(1), touch.kpa.toFixed(0)])));
    total.textContent = `${picture.touches.length || "No"} touch${picture.touches.length === 1 ? "" : "es"}; force ${fixed(picture.force_n, 1)} N${between(picture, "force_n", 1)}`;
    const peak = between(picture, "peak_kpa", 0);
    if (peak && !picture.outside_training) total.textContent += `; peak ${picture.peak.toFixed(0)} kPa${peak}`;
    element("prediction").setAttribute("aria-label", `Pressure map: ${picture.touches.map((touch) =>
      `${touch.kpa.toFixed(0)} kPa at ${touch.x_mm.toFixed(0)}, ${touch.y_mm.toFixed(0)} mm`).join("; ") || "no touch"}`);
  } else if (model.kind === "images") {
    total.textContent = `Most likely: ${picture.object}`;
    if (picture.outside_training) total.textContent += "; no set: outside the training";
    else if (picture.objects) total.textContent += `; the 90 % set: ${picture.objects.join(", ")}`;
  } else {
    const values = picture.values ?? [picture.force_n];
    const names = model.names ?? ["force_n"];
    body.replaceChildren(...values.map((value, place) =>
      cells("td", [`${names[place].replace(/_\w+$/, "")} (${["line", "dashes", "dots"][place % 3]})`, fixed(value, 2) + between(picture, names[place], 2)])));
    element("prediction").setAttribute("aria-label", `Plot of the last ${HELD_S} s: ${values.map((value, place) =>
      `${names[place].replace("_", " in ")} ${fixed(value, 2)}`).join(", ")}`);
  }
  element("reading").setAttribute("aria-label", `Reading: ${picture.reading.length} values from ${Math.min(...picture.reading)} to ${Math.max(...picture.reading)} ${model.reading.unit}`);
  status(picture.status);
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
  const notes = element("notes");
  if (notes.children.length !== one.notes.length) {
    notes.replaceChildren(...one.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
    notes.hidden = !one.notes.length;
  }
}

function show(name, words) {
  state = name;
  const place = element("state");
  if (place.textContent !== words) [place.textContent, place.dataset.state] = [words, name];
}

function listen() {
  const events = new EventSource("pictures");
  events.addEventListener("model", (event) => {
    model = JSON.parse(event.data);
    drawn = waiting = null; // a word is of the pictures of this connection
    model.viridis = bytes(model.viridis);
    document.title = `${model.name} live`;
    element("name").textContent = model.name;
    element("prediction-title").textContent = model.touch_kpa !== null ? "Pressure map" :
      model.kind === "images" ? "Object" : model.unit === "N" ? "Force in N" : "Position in mm";
    element("bars").hidden = model.kind !== "images";
    element("prediction").hidden = model.kind === "images";
    element("values").hidden = model.kind === "images";
    element("intervals").textContent = model.intervals.join(". ");
    element("values-title").textContent = model.touch_kpa !== null ? "Touches" : "Values";
    if (model.touch_kpa !== null) {
      element("values").tHead.replaceChildren(cells("th", ["touch", "x, mm", "y, mm", "kPa"]));
      element("prediction-scale").textContent =
        `From the lower left corner; a ring is a peak of at least ${model.touch_kpa.toFixed(0)} kPa`;
    } else if (model.kind !== "images") {
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
  events.addEventListener("end", (event) => {
    events.close();
    draw();
    if (drawn) say(drawn);
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
  if (waiting !== null && document.hidden) { // nothing is drawn, but what comes must not pile up
    drawn = JSON.parse(waiting);
    waiting = null;
    report(null);
  } else if (drawn !== null && state !== "ended" && silent > QUIET_MS) {
    report(null);
  }
}, 1000);
