"use strict";

/* The page: sliders ask, answers are shown. Every change is asked at once; the server answers the newest question. */

const REST = 150; // ms without a change, after which extremes, frequencies and the drawing follow
const PATIENCE = 300; // ms after which the page says that it waits
const TICKS = 500; // of a slider, from its middle to each end

const byId = id => document.getElementById(id);
const setup = JSON.parse(byId("setup").textContent);
const precomputed = JSON.parse(byId("answers").textContent);
const values = new Map(setup.sliders.map(slider => [slider.name, slider.value]));
const controls = new Map();
const starts = new Map();
const startFields = new Map();

let layout = null; // axes of the plot and the train, which the first answer brings
let stage = null;
let shown = null; // the answer with curves that is shown
let reference = null; // the one that is kept for comparison
let extremes = [];
let modes = [];
let asked = 0; // questions so far; the last one's number
const questions = new Map(); // by number, those that may still be answered
let resting = 0;
let waiting = 0;
let playing = null;
let updates = [];

function printed(number, digits = 6) {
  return Number.isFinite(number) ? String(Number(number.toPrecision(digits))) : "";
}

/** A unit as it is written by hand. */
function spelled(unit) {
  return unit === "1" ? "" : unit.replaceAll("*", " ").replaceAll("^2", "²").replaceAll("^3", "³");
}

function numbers(packed) {
  const text = atob(packed.bdata);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  return new Float64Array(bytes.buffer);
}

/* Answers ------------------------------------------------------------------------------------------------------- */

/** Ask the server of this page; what it answers goes to `accept`. */
function askServer() {
  let line = null;
  return question => {
    const send = () => question.number === asked && line.send(JSON.stringify(question));
    if (!line) {
      line = new WebSocket(`ws://${location.host}/answers`);
      line.onmessage = event => accept(JSON.parse(event.data));
      line.onclose = () => {
        line = null;
        compute(false);
        say("The command `shaftwork open` has ended. Start it again to go on.");
      };
    }
    if (line.readyState === WebSocket.OPEN) send();
    else line.addEventListener("open", send);
  };
}

/** Look among answers that were computed before: sliders stop at their values only. */
function askStored(question) {
  let place = 0;
  for (const { name, values: offered } of precomputed.sliders) place = place * offered.length + offered.indexOf(values.get(name));
  const answer = { layout: precomputed.layout, ...precomputed.answers[place], number: question.number };
  queueMicrotask(() => accept(answer));
}

const ask = precomputed ? askStored : askServer();

/** Put a question about the newest values; those before it are of no interest any more. */
function put(want) {
  asked += 1;
  const question = { number: asked, ...request(want) };
  questions.set(asked, question);
  compute(true);
  ask(question);
}

/** Say that an answer is waited for, where it takes longer than a moment. */
function compute(isWaiting) {
  clearTimeout(waiting);
  if (isWaiting) waiting = setTimeout(() => (byId("computing").hidden = false), PATIENCE);
  else byId("computing").hidden = true;
}

function numberOr(text) {
  return text !== "" && Number.isFinite(Number(text)) ? Number(text) : text;
}

function request(want) {
  const set = Object.fromEntries(setup.sliders.filter(one => values.get(one.name) !== one.value).map(one => [one.name, values.get(one.name)]));
  const question = { set, initial: Object.fromEntries(starts), want, t_end: numberOr(byId("end").value.trim()) };
  if (byId("at").checked) question.at = time();
  return question;
}

/** Show the newest values: curves at once, and what takes longer when the values rest. */
function follow() {
  clearTimeout(resting);
  for (const part of document.querySelectorAll(".detail")) part.classList.add("stale");
  put(layout ? ["curves"] : ["curves", "layout"]);
}

/** Show an answer, if it is not older than what is shown; ask on once it is that to the newest question. */
function accept(answer) {
  const question = questions.get(answer.number);
  if (!question) return;
  for (const number of questions.keys()) if (number <= answer.number) questions.delete(number);
  const isNewest = answer.number === asked;
  if (isNewest) compute(false);
  if (isNewest || !answer.error) object(answer);
  if (answer.error) return;
  if (answer.layout) arrange(answer.layout);
  if (answer.curves) showCurves(answer);
  if (!isNewest) return;
  showDetail(answer);
  byId("results").dataset.set = JSON.stringify(question.set);
  if (answer.curves && !precomputed) resting = setTimeout(() => put(["extremes", "modes"]), REST);
  if (answer.modes && !precomputed) put(["drawing"]);
}

/** Say what is wrong beside the fields that it is about, all else on top. */
function object({ error = "", fields: { set: wrong = {}, initial = {}, t_end: end } = {} }) {
  const rows = [...controls].map(([name, row]) => [row, wrong[name]]).concat([...startFields].map(([name, row]) => [row, initial[name]]));
  for (const [{ field, wrong: place }, text] of rows) {
    field.setAttribute("aria-invalid", Boolean(text));
    place.textContent = text || "";
    place.hidden = !text;
  }
  byId("end").setAttribute("aria-invalid", Boolean(end));
  const beside = new Set(rows.map(([, text]) => text));
  say(error.split("\n").filter(line => !beside.has(line)).join("\n"));
}

function state(text) {
  byId("state").textContent = text;
}

/** Take what stays while values change. */
function arrange(given) {
  if (layout) return;
  layout = given;
  stage = new Stage(byId("stage"), layout.stage);
  makeLegend();
  byId("results").classList.remove("waiting");
}

function say(text) {
  byId("message").textContent = text;
  byId("message").hidden = !text;
}

/* Sliders ------------------------------------------------------------------------------------------------------- */

function valueAt(slider, tick) {
  if (slider.offered) return slider.offered[tick];
  const share = tick / TICKS;
  if (share === 0) return slider.value;
  const value = slider.value * (share < 0 ? (slider.value / slider.low) ** share : (slider.high / slider.value) ** share);
  return slider.whole ? Math.round(value) : Number(value.toPrecision(4));
}

function tickOf(slider, value) {
  if (slider.offered) return slider.offered.reduce((best, one, k) => (Math.abs(one - value) < Math.abs(slider.offered[best] - value) ? k : best), 0);
  const ratio = value / slider.value;
  if (!(ratio > 0)) return 0;
  const end = ratio < 1 ? slider.value / slider.low : slider.high / slider.value;
  const share = end > 1 ? Math.log(ratio) / Math.log(end) : 0;
  return Math.round(TICKS * Math.min(1, Math.max(-1, share)));
}

/** Set a value; a text that is no number goes to the library as it is, which says what is wrong. */
function set(slider, value) {
  const control = controls.get(slider.name);
  values.set(slider.name, value);
  const isNumber = typeof value === "number";
  control.field.value = isNumber ? printed(value) : value;
  if (isNumber) control.range.value = tickOf(slider, value);
  control.range.setAttribute("aria-valuetext", `${control.field.value} ${slider.unit}`);
  control.row.classList.toggle("changed", value !== slider.value);
}

function typed(slider) {
  const value = numberOr(controls.get(slider.name).field.value.trim());
  const isNumber = typeof value === "number";
  if (slider.offered && !isNumber) return set(slider, values.get(slider.name));
  if (printed(values.get(slider.name)) === String(value)) return undefined;
  set(slider, slider.offered ? valueAt(slider, tickOf(slider, value)) : value);
  return follow();
}

/** A row for one value: its symbol, what it is, its unit and bounds, and a place for what is wrong with it. */
function makeRow(name, { symbol, unit, bounds = "" }, words, id) {
  const [row, label, field, of, within, wrong] = ["div", "label", "input", "span", "span", "span"].map(kind => document.createElement(kind));
  const [letter, subscript] = ["span", "sub"].map(kind => document.createElement(kind));
  row.className = "value";
  letter.className = "symbol";
  [letter.textContent, subscript.textContent] = symbol;
  letter.append(subscript);
  label.append(letter, ` ${words}`);
  label.title = name;
  label.htmlFor = id;
  Object.assign(field, { type: "text", inputMode: "decimal" });
  field.dataset.name = name;
  field.setAttribute("aria-label", `${name} in ${unit}`);
  Object.assign(of, { className: "unit", textContent: spelled(unit) });
  Object.assign(within, { className: "bounds", textContent: bounds, hidden: !bounds });
  Object.assign(wrong, { className: "wrong", hidden: true, id: `wrong-${id}` });
  wrong.setAttribute("role", "alert");
  field.setAttribute("aria-describedby", wrong.id);
  row.append(label, field, of, within, wrong);
  return { row, label, field, wrong };
}

function makeSlider(slider, place) {
  const stored = precomputed && precomputed.sliders.find(one => one.name === slider.name);
  if (precomputed && !stored) return null;
  if (stored) slider.offered = stored.values;
  const { row, label, field, wrong } = makeRow(slider.name, slider, slider.meaning, `slider-${place}`);
  const range = document.createElement("input");
  Object.assign(range, { id: label.htmlFor, type: "range", step: 1 });
  Object.assign(range, { min: stored ? 0 : -TICKS, max: stored ? stored.values.length - 1 : TICKS });
  range.dataset.name = slider.name;
  range.addEventListener("input", () => {
    set(slider, valueAt(slider, Number(range.value)));
    follow();
  });
  field.addEventListener("change", () => typed(slider));
  label.title = `${slider.name}; double-click: back to the value of the network`;
  label.addEventListener("dblclick", () => {
    set(slider, slider.value);
    follow();
  });
  label.after(range);
  controls.set(slider.name, { row, range, field, wrong });
  set(slider, slider.value);
  return row;
}

/** A field for a start value; an empty one is left to the library, which begins at rest. */
function makeStart(start, place) {
  const words = `of ${start.name.slice(0, start.name.lastIndexOf("."))}`;
  const { row, field, wrong, label } = makeRow(start.name, start, words, `start-${place}`);
  Object.assign(field, { id: label.htmlFor, placeholder: "rest" });
  row.classList.add("start");
  field.addEventListener("change", () => {
    setStart(start, numberOr(field.value.trim()));
    follow();
  });
  startFields.set(start.name, { field, wrong });
  setStart(start, start.value);
  return row;
}

function setStart(start, value) {
  const isNone = value === null || value === "";
  if (isNone) starts.delete(start.name);
  else starts.set(start.name, value);
  startFields.get(start.name).field.value = isNone ? "" : typeof value === "number" ? printed(value) : value;
}

function makeGroup(title, rows, open) {
  if (!rows.length) return;
  const [group, heading] = ["details", "summary"].map(name => document.createElement(name));
  group.open = open;
  heading.textContent = title;
  group.append(heading, ...rows);
  byId("values").append(group);
}

function makeFields() {
  const parts = Map.groupBy(setup.sliders, slider => slider.name.slice(0, slider.name.lastIndexOf(".")));
  const open = setup.sliders.length <= 24 || Boolean(precomputed);
  for (const [part, sliders] of parts) {
    makeGroup(part, sliders.map(slider => makeSlider(slider, setup.sliders.indexOf(slider))).filter(Boolean), open);
  }
  if (!precomputed) makeGroup("Start of the motion", setup.starts.map(makeStart), starts.size > 0);
}

/* What is shown ------------------------------------------------------------------------------------------------- */

function showCurves(answer) {
  const start = performance.now();
  const t = numbers(answer.t);
  const curves = Object.fromEntries(Object.entries(answer.curves).map(([name, packed]) => [name, numbers(packed)]));
  shown = { ...answer, t, curves };
  extremes = [];
  drawPlot();
  showPhases();
  stage.update(t, answer.train, answer.phases, name => values.get(name));
  byId("scale").textContent = stage.scale;
  showTime();
  updates = [...updates.filter(then => then > start - 1000), start];
  const { simulate, read: reading } = answer.milliseconds;
  const rate = updates.length > 1 ? `, ${updates.length} updates in the last second` : "";
  const computed = precomputed ? "Computed before" : `Simulated in ${simulate.toFixed(1)} ms, read in ${reading.toFixed(1)} ms`;
  const warned = answer.warnings.length ? ` ${answer.warnings.join(" ")}` : "";
  state(`${computed}, drawn in ${(performance.now() - start).toFixed(0)} ms${rate}.${warned}`);
}

function showPhases() {
  byId("phases").hidden = !shown.phases.length;
  const rows = shown.phases.map(row => [row.start, row.end, Object.entries(row.modes).map(([part, mode]) => `${part} ${mode}`).join(", ")]);
  fill("phases", rows);
}

function showExtremes() {
  const place = placeOf(shown.t, time());
  const rows = layout.axes.flatMap(axis =>
    axis.signals.map(name => {
      const row = extremes.find(one => one.name === name);
      const ends = row ? [row.min, row.t_min, row.max, row.t_max] : sampled(shown.curves[name]);
      return [name, spelled(axis.unit), read(shown.curves[name], place), ...ends];
    }),
  );
  fill("extremes", rows);
}

/** Extremes of what is drawn, to be told from those of the motion, which follow when the values rest. */
function sampled(curve) {
  const [least, most] = [Math.min(...curve), Math.max(...curve)];
  return [least, most].flatMap(value => [`≈ ${printed(value, 4)}`, `≈ ${printed(shown.t[curve.indexOf(value)], 4)}`]);
}

function showModes(answer) {
  modes = answer.modes;
  const before = stage.mode && stage.mode.name;
  const choices = [{ name: "", frequency: 0 }, ...modes].map(mode => {
    const choice = document.createElement("input");
    Object.assign(choice, { type: "radio", name: "swing", checked: mode.name === (before || "") });
    choice.setAttribute("aria-label", mode.name ? `Swing ${mode.name}` : "Show the motion");
    choice.addEventListener("change", () => swing(mode.name ? mode : null));
    return choice;
  });
  const rows = modes.map((mode, k) => [choices[k + 1], mode.name, mode.frequency, mode.damping, mode.node]);
  fill("modes", [[choices[0], "none, show the motion", "", "", ""], ...rows]);
  byId("without").textContent = answer["without modes"] || "";
  const same = modes.find(mode => mode.name === before);
  if (before) swing(same || null);
}

function showDetail(answer) {
  if (answer.extremes) {
    extremes = answer.extremes;
    drawPlot();
    showExtremes();
    byId("extremes").closest(".detail").classList.remove("stale");
  }
  if (answer.modes) {
    showModes(answer);
    byId("modes").closest(".detail").classList.remove("stale");
  }
  if (answer.drawing) {
    byId("drawing").innerHTML = answer.drawing;
    byId("drawing").closest(".detail").classList.remove("stale");
  }
}

/* Motion -------------------------------------------------------------------------------------------------------- */

/** Seconds of the motion that one second plays. */
function playRate() {
  return (shown.t.at(-1) - shown.t[0]) / (shown.train ? shown.train.seconds : 10);
}

function time() {
  if (!shown) return 0;
  return shown.t[0] + (Number(byId("time").value) / 1000) * (shown.t.at(-1) - shown.t[0]);
}

function showTime() {
  if (!shown) return;
  byId("now").textContent = `t = ${time().toFixed(3)} s`;
  showExtremes();
  stage.draw(time(), performance.now() / 1000);
}

function swing(mode) {
  stage.mode = mode;
  byId("scale").textContent = stage.scale;
  showTime();
  if (mode) animate();
}

function animate() {
  if (animate.running) return;
  animate.running = true;
  let before = performance.now();
  const frame = now => {
    if (playing) {
      const length = shown.t.at(-1) - shown.t[0];
      const next = Number(byId("time").value) + (1000 * ((now - before) / 1000) * playRate()) / length;
      byId("time").value = next > 1000 ? 0 : next;
      showTime();
    } else if (stage.mode) stage.draw(time(), now / 1000);
    before = now;
    animate.running = Boolean(playing || stage.mode);
    if (animate.running) requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

function play() {
  playing = !playing;
  byId("play").textContent = playing ? "Pause" : "Play";
  if (playing) {
    swing(null);
    for (const choice of document.querySelectorAll('[name="swing"]')) choice.checked = choice.getAttribute("aria-label") === "Show the motion";
    animate();
  }
}

/* Tools --------------------------------------------------------------------------------------------------------- */

async function download(name) {
  const { want, ...changes } = request([]);
  state(`${name} is being written.`);
  const response = await fetch(`/files/${name}`, { method: "POST", body: JSON.stringify(changes) });
  state("");
  if (!response.ok) return say(await response.text());
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await response.blob());
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
  state(`${name} is saved.`);
  return undefined;
}

function start() {
  byId("source").textContent = setup.source;
  byId("end").value = printed(setup.t_end);
  makeFields();
  byId("end").addEventListener("change", follow);
  byId("tools").addEventListener("submit", event => event.preventDefault());
  byId("reset").addEventListener("click", () => {
    for (const slider of setup.sliders) if (controls.has(slider.name)) set(slider, slider.value);
    for (const start of setup.starts) if (startFields.has(start.name)) setStart(start, start.value);
    byId("end").value = printed(setup.t_end);
    follow();
  });
  byId("keep").addEventListener("click", () => {
    reference = reference ? null : shown;
    byId("keep").textContent = reference ? "Drop the reference" : "Keep as reference";
    drawPlot();
  });
  for (const button of document.querySelectorAll("[data-file]")) {
    button.addEventListener("click", () => download(button.dataset.file).catch(error => say(error.message)));
  }
  byId("time").addEventListener("input", showTime);
  byId("time").addEventListener("change", () => byId("at").checked && follow());
  byId("at").addEventListener("change", follow);
  byId("play").addEventListener("click", play);
  addEventListener("resize", showTime);
  if (location.search) history.replaceState(null, "", location.pathname); // a cookie has the token by now
  if (precomputed) {
    for (const part of [byId("downloads"), byId("about"), byId("end").closest("label")]) part.hidden = true;
  }
  follow();
}

start();
