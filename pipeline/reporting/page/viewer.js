"use strict";

// The viewer: one touch as the sensor, the label and a model have it, over time.

for (const viewer of document.querySelectorAll(".viewer")) {
  const data = JSON.parse(viewer.querySelector("script").textContent);
  const [touch, model] = viewer.querySelectorAll("select");
  const time = viewer.querySelector("input[type=range]");
  const play = viewer.querySelector("button");
  const words = viewer.querySelector("output");
  const canvases = Object.fromEntries([...viewer.querySelectorAll("canvas")].map((canvas) => [canvas.dataset.of, canvas]));
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  let timer = null;
  let shown = null;

  data.touches.forEach((one, place) => touch.append(new Option(one.name, place)));
  Object.keys(data.touches[0].predictions).forEach((name) => model.append(new Option(name, name)));
  model.value = [...model.options].at(-1).value;

  // Row 0 of a map is at the lower edge, as in the figures.
  function paint(canvas, values, [rows, columns], colour) {
    canvas.width = columns;
    canvas.height = rows;
    const context = canvas.getContext("2d");
    for (let row = 0; row < rows; row += 1) {
      for (let column = 0; column < columns; column += 1) {
        context.fillStyle = colour(values[row * columns + column]);
        context.fillRect(column, rows - 1 - row, 1, 1);
      }
    }
  }

  function choose() {
    const one = data.touches[Number(touch.value)];
    const prediction = one.predictions[model.value];
    shown = { one, rmse: prediction.rmse_kpa, reading: bytes(one.reading), label: bytes(one.label), map: bytes(prediction.map) };
    time.max = one.seconds.length - 1;
    draw();
  }

  function draw() {
    const place = Number(time.value);
    const part = (values, [rows, columns]) => values.subarray(place * rows * columns, (place + 1) * rows * columns);
    const { reading, map } = data.shape;
    const viridis = (value) => d3.interpolateViridis(value / 255);
    const [label, predicted] = [part(shown.label, map), part(shown.map, map)];
    paint(canvases.reading, part(shown.reading, reading), reading, viridis);
    paint(canvases.label, label, map, viridis);
    paint(canvases.prediction, predicted, map, viridis);
    const error = Int16Array.from(predicted, (value, cell) => value - label[cell]);
    paint(canvases.error, error, map, (value) => d3.interpolateRdBu(0.5 - value / 510));
    words.textContent = `${shown.one.seconds[place].toFixed(1)} s: ${model.value} is off by ${shown.rmse[place].toFixed(1)} kPa (RMSE); ` +
      `yellow is ${shown.one.largest_kpa.toFixed(0)} kPa or ${shown.one.largest_count.toFixed(0)} counts; error: red too much, blue too little`;
  }

  function stop() {
    clearInterval(timer);
    timer = null;
    play.textContent = "Play";
  }

  function halfway() {
    choose();
    time.value = Math.floor(Number(time.max) / 2); // where it is pressed hardest
    draw();
  }

  touch.addEventListener("input", halfway);
  model.addEventListener("input", choose);
  time.addEventListener("input", draw);
  play.addEventListener("click", () => {
    if (timer) return stop();
    play.textContent = "Stop";
    timer = setInterval(() => {
      time.value = (Number(time.value) + 1) % (Number(time.max) + 1);
      draw();
    }, 400);
  });
  if (data.touches.length > 1) touch.value = "1"; // two touches: what the paper is about
  halfway();
}
