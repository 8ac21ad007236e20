"use strict";

// The charts of the page: data as JSON in the page, drawn by Observable Plot. One tab stop per chart; arrow keys move
// from point to point, and the sentence of the point stands above the charts.

const INK = "#1a1a1a";
const SOFT = "#777";

// A marker as matplotlib draws it: polygons within -1 to 1; `size` is the area that d3's symbols have.
function symbolOf(look) {
  return {
    draw(context, size) {
      const radius = Math.sqrt(size / Math.PI);
      for (const polygon of look.polygons) {
        polygon.forEach(([x, y], place) => context[place ? "lineTo" : "moveTo"](radius * x, -radius * y));
        if (look.closed) context.closePath();
      }
    },
  };
}

function dots(rows, models, x, y, radius) {
  return rows.map((row) => {
    const look = models[row.model];
    return Plot.dot([row], {
      x, y, r: radius, symbol: symbolOf(look), stroke: look.closed && row.filled ? INK : look.color,
      fill: look.closed ? (row.filled ? look.color : "#fff") : "none", strokeWidth: look.closed && row.filled ? 0.8 : 2,
    });
  });
}

// Where a name fits beside its point: the first of these places where it covers neither a name nor a point.
const PLACES = [[9, 0], [-9, 0], [0, -11], [0, 12], [9, -11], [9, 12], [-9, -11], [-9, 12], [9, -23], [9, 24], [-9, -23], [-9, 24]];

function names(rows, toX, toY, width) {
  const taken = rows.map((row) => [toX(row) - 6, toY(row) - 6, toX(row) + 6, toY(row) + 6]);
  return rows.map((row) => {
    const long = row.label.length * 5.9;
    const boxes = PLACES.map(([dx, dy]) => {
      const left = toX(row) + dx - (dx < 0 ? long : dx === 0 ? long / 2 : 0);
      return [left, toY(row) + dy - 6, left + long, toY(row) + dy + 6];
    });
    const cost = (box) =>
      taken.reduce((sum, other) => sum + Math.max(0, Math.min(box[2], other[2]) - Math.max(box[0], other[0])) *
        Math.max(0, Math.min(box[3], other[3]) - Math.max(box[1], other[1])), 0) +
      (box[0] < 42 ? 1e4 : 0) + (box[2] > width - 2 ? 1e4 : 0) + (box[1] < 4 ? 1e4 : 0);
    const costs = boxes.map(cost);
    const best = costs.indexOf(Math.min(...costs));
    taken.push(boxes[best]);
    const [dx, dy] = PLACES[best];
    return { dx, dy, textAnchor: dx < 0 ? "end" : dx === 0 ? "middle" : "start", row };
  });
}

function extent(values, log) {
  const known = values.filter((value) => value !== null && (!log || value > 0));
  if (!known.length) return log ? [0.1, 1] : [0, 1];
  const low = Math.min(...known);
  const high = Math.max(...known);
  return log ? [low / 1.25, high * 1.25] : [Math.min(0, low), high * 1.08];
}

// Speed against accuracy: one panel per panel of the table and measured time.
function panels(data, state) {
  const kinds = Object.keys(data.axes).flatMap((axis) => [...new Set(data.rows.map((row) => row.panel))].map((panel) => [axis, panel]));
  return kinds.map(([axis, panel]) => {
    const rows = data.rows.filter((row) => row.axis === axis && row.panel === panel && !state.hidden.has(row.model));
    const type = state.log ? "log" : "linear";
    const good = rows.filter((row) => !row.failed && row.error !== null && (!state.log || row.error > 0));
    const failed = rows.filter((row) => row.failed);
    // An interval may leave the panel, the points may not.
    const heights = good.map((row) => row.error);
    const y = extent([...heights, ...good.map((row) => (row.high === null ? null : Math.min(row.high, 1.2 * Math.max(...heights))))], state.log);
    const x = extent(rows.flatMap((row) => [row.time_low, row.time_high, row.time]), state.log);
    const [width, height] = [400, 330];
    const frame = { width, height, marginLeft: 48, marginRight: 16, marginTop: 22, marginBottom: 40 };
    const scales = {
      x: { type, domain: x, label: data.axes[axis], ticks: 5, tickFormat: state.log ? "~g" : undefined, grid: true },
      y: { type, domain: y, label: rows.length ? rows[0].measure : "", ticks: y[1] < 10 * y[0] ? d3.ticks(...y, 5) : 5, tickFormat: state.log ? "~g" : undefined, grid: true },
    };
    const toX = Plot.scale({ x: { ...scales.x, range: [frame.marginLeft, width - frame.marginRight] } }).apply;
    const toY = Plot.scale({ y: { ...scales.y, range: [height - frame.marginBottom, frame.marginTop] } }).apply;
    const drawn = good.map((row) => ({ ...row, filled: row.front === 1 }));
    const front = drawn.filter((row) => row.filled).sort((a, b) => a.time - b.time || b.error - a.error);
    const points = [...drawn, ...failed.map((row) => ({ ...row, error: y[1], filled: false }))].sort((a, b) => a.time - b.time);
    const placed = names(points, (row) => toX(row.time), (row) => toY(row.error), width);
    return {
      caption: `${panel}: ${data.axes[axis].toLowerCase()}${rows.length && rows[0].machine ? `, on ${rows[0].machine}` : ""}`,
      points: points.map((row) => ({ ...row, at: [toX(row.time), toY(row.error)] })),
      options: {
        ...frame, ...scales, ariaLabel: `${data.name}, ${panel}: ${scales.y.label} against ${data.axes[axis].toLowerCase()}, ${rows.length} models`,
        marks: [
          Plot.line(front, { x: "time", y: "error", curve: "step-after", stroke: SOFT, strokeWidth: 1.2 }),
          Plot.ruleX(drawn.filter((row) => row.low !== null), { x: "time", y1: (row) => Math.max(row.low, y[0]), y2: (row) => Math.min(row.high, y[1]), stroke: "#555" }),
          Plot.ruleY(drawn, { y: "error", x1: "time_low", x2: "time_high", stroke: "#555" }),
          ...dots(drawn, data.models, "time", "error", 6),
          Plot.dot(points.filter((row) => row.failed), { x: "time", y: "error", symbol: "times", stroke: "#d55e00", strokeWidth: 2.5, r: 6 }),
          ...placed.map(({ row, ...place }) => Plot.text([row], { x: "time", y: "error", text: "label", ...place, fill: INK, fontSize: 11, stroke: "#fff", strokeWidth: 3 })),
        ],
      },
    };
  });
}

function button(words, pressed, act) {
  const made = document.createElement("button");
  made.type = "button";
  made.append(words);
  made.setAttribute("aria-pressed", String(pressed));
  made.addEventListener("click", () => {
    const now = made.getAttribute("aria-pressed") !== "true";
    made.setAttribute("aria-pressed", String(now));
    act(now);
  });
  return made;
}

// The marker of a model, for its button.
function marker(look) {
  const path = d3.path();
  symbolOf(look).draw(path, Math.PI * 36);
  const svg = d3.create("svg").attr("viewBox", "-9 -9 18 18").attr("width", 16).attr("height", 16).attr("aria-hidden", "true");
  svg.append("path").attr("d", path).attr("fill", look.closed ? look.color : "none").attr("stroke", look.closed ? INK : look.color).attr("stroke-width", look.closed ? 0.8 : 2);
  return svg.node();
}

for (const charts of document.querySelectorAll(".charts")) {
  const data = JSON.parse(charts.querySelector("script").textContent);
  const readout = charts.querySelector(".readout");
  const state = { log: true, hidden: new Set() };

  function step(chart, points, by) {
    const now = Number(chart.dataset.place ?? -1) + by;
    show(chart, points, Math.min(points.length - 1, Math.max(0, now)));
  }
  function show(chart, points, place) {
    chart.dataset.place = place;
    const point = points[place];
    readout.textContent = point.words;
    for (const ring of charts.querySelectorAll(".ring")) ring.remove();
    d3.select(chart).select("svg").append("circle").attr("class", "ring").attr("cx", point.at[0]).attr("cy", point.at[1]).attr("r", 10);
  }

  function draw() {
    const figures = panels(data, state).map(({ caption, points, options }) => {
      const figure = document.createElement("figure");
      const chart = document.createElement("div");
      chart.className = "chart";
      chart.tabIndex = 0;
      chart.setAttribute("role", "application");
      chart.setAttribute("aria-label", `${options.ariaLabel}; arrow keys step through them`);
      const svg = Plot.plot({ ...options, style: { fontSize: "11.5px" } });
      svg.setAttribute("aria-hidden", "true");
      chart.append(svg);
      chart.addEventListener("keydown", (event) => {
        const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
        if (!by || !points.length) return;
        event.preventDefault();
        step(chart, points, by);
      });
      chart.addEventListener("pointermove", (event) => {
        const box = svg.getBoundingClientRect();
        const scale = options.width / box.width;
        const [x, y] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
        const near = d3.minIndex(points, (point) => (point.at[0] - x) ** 2 + (point.at[1] - y) ** 2);
        if (near >= 0 && near !== Number(chart.dataset.place)) show(chart, points, near);
      });
      const words = document.createElement("figcaption");
      words.textContent = caption;
      figure.append(words, chart);
      return figure;
    });
    charts.querySelector(".panels").replaceChildren(...figures);
  }

  const controls = charts.querySelector(".controls");
  controls.append(button("Logarithmic axes", true, (now) => { state.log = now; draw(); }));
  for (const [model, look] of Object.entries(data.models)) {
    const toggle = button("", true, (now) => { state.hidden[now ? "delete" : "add"](model); draw(); });
    toggle.append(marker(look), look.label);
    controls.append(toggle);
  }
  draw();
}
