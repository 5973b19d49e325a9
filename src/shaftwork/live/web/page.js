"use strict";

/* The page: sliders ask, answers are shown. One question is on its way at a time, and the newest values win. While an
   answer is drawn, the next one is computed. */

const REST = 150; // ms without a change, after which extremes, frequencies and the drawing follow
const TICKS = 500; // of a slider, from its middle to each end

const byId = id => document.getElementById(id);
const setup = JSON.parse(byId("setup").textContent);
const precomputed = JSON.parse(byId("answers").textContent);
const values = new Map(setup.sliders.map(slider => [slider.name, slider.value]));
const controls = new Map();
const stage = new Stage(byId("stage"), setup.stage);

let shown = null; // the answer with curves that is shown
let reference = null; // the one that is kept for comparison
let extremes = [];
let modes = [];
let busy = false;
let changed = false;
let resting = 0;
let playing = null;
let updates = [];

function printed(number, digits = 6) {
  return Number.isFinite(number) ? String(Number(number.toPrecision(digits))) : "";
}

function numbers(packed) {
  const text = atob(packed.bdata);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  return new Float64Array(bytes.buffer);
}

/* Answers ------------------------------------------------------------------------------------------------------- */

/** Ask the server of this page: one question at a time. */
function askServer() {
  let socket = null;
  const connected = () =>
    new Promise((resolve, reject) => {
      if (socket && socket.readyState === WebSocket.OPEN) return resolve(socket);
      socket = new WebSocket(`ws://${location.host}/answers`);
      socket.onopen = () => resolve(socket);
      socket.onerror = () => reject(new Error("The command `shaftwork open` has ended. Start it again to go on."));
    });
  return async request => {
    const line = await connected();
    return new Promise((resolve, reject) => {
      line.onmessage = event => resolve(JSON.parse(event.data));
      line.onclose = () => reject(new Error("The command `shaftwork open` has ended. Start it again to go on."));
      line.send(JSON.stringify(request));
    });
  };
}

/** Look among answers that were computed before: sliders stop at their values only. */
function askStored() {
  return async () => {
    let place = 0;
    for (const { name, values: offered } of precomputed.sliders) place = place * offered.length + offered.indexOf(values.get(name));
    return precomputed.answers[place];
  };
}

const ask = precomputed ? askStored() : askServer();

/** A question about the newest values, and its answer once it is there. */
async function exchange(want) {
  changed = false;
  const question = request(want);
  return { question, answer: await ask(question) };
}

function request(want) {
  const set = Object.fromEntries(setup.sliders.filter(one => values.get(one.name) !== one.value).map(one => [one.name, values.get(one.name)]));
  const end = byId("end").value.trim();
  const question = { set, want, t_end: end !== "" && Number.isFinite(Number(end)) ? Number(end) : end };
  if (byId("at").checked) question.at = time();
  return question;
}

/** Show the newest values: curves at once, and what takes longer when the values rest. */
async function follow() {
  changed = true;
  clearTimeout(resting);
  for (const part of document.querySelectorAll(".detail")) part.classList.add("stale");
  if (busy) return;
  busy = true;
  try {
    for (let coming = exchange(["curves"]); coming; ) {
      const newest = await coming;
      coming = changed ? exchange(["curves"]) : null;
      accept(newest, showCurves);
    }
  } catch (error) {
    say(error.message);
  }
  busy = false;
  resting = setTimeout(detail, REST);
}

async function detail() {
  if (busy) return;
  busy = true;
  try {
    for (const want of [["extremes", "modes"], ["drawing"]]) {
      if (!changed) accept(await exchange(want), showDetail);
    }
  } catch (error) {
    say(error.message);
  }
  busy = false;
  if (changed) follow();
}

function accept({ question, answer }, show) {
  if (answer.error) {
    say(answer.error);
    return;
  }
  say("");
  for (const control of controls.values()) control.field.removeAttribute("aria-invalid");
  show(answer);
  byId("results").dataset.set = JSON.stringify(question.set);
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
  const control = controls.get(slider.name);
  const text = control.field.value.trim();
  const number = text === "" ? NaN : Number(text);
  const value = slider.offered && Number.isFinite(number) ? valueAt(slider, tickOf(slider, number)) : number;
  if (slider.offered && !Number.isFinite(number)) return set(slider, values.get(slider.name));
  if (printed(values.get(slider.name)) === text) return undefined;
  set(slider, Number.isFinite(value) ? value : text);
  return follow().then(() => byId("message").hidden || control.field.setAttribute("aria-invalid", "true"));
}

function makeSlider(slider, place) {
  const stored = precomputed && precomputed.sliders.find(one => one.name === slider.name);
  if (precomputed && !stored) return null;
  if (stored) slider.offered = stored.values;
  const [row, label, range, field] = ["div", "label", "input", "input"].map(name => document.createElement(name));
  const key = slider.name.slice(slider.name.lastIndexOf(".") + 1);
  row.className = "value";
  label.textContent = `${key}: ${slider.meaning}${slider.unit === "1" ? "" : ` in ${slider.unit}`}`;
  label.htmlFor = range.id = `slider-${place}`;
  Object.assign(range, { type: "range", step: 1, min: stored ? 0 : -TICKS, max: stored ? stored.values.length - 1 : TICKS });
  range.dataset.name = field.dataset.name = slider.name;
  Object.assign(field, { type: "text", inputMode: "decimal" });
  field.setAttribute("aria-label", `${slider.name} in ${slider.unit}`);
  range.addEventListener("input", () => {
    set(slider, valueAt(slider, Number(range.value)));
    follow();
  });
  field.addEventListener("change", () => typed(slider));
  label.title = "Double-click: back to the value of the network";
  label.addEventListener("dblclick", () => {
    set(slider, slider.value);
    follow();
  });
  row.append(label, range, field);
  controls.set(slider.name, { row, range, field });
  set(slider, slider.value);
  return row;
}

function makeSliders() {
  const parts = Map.groupBy(setup.sliders, slider => slider.name.slice(0, slider.name.lastIndexOf(".")));
  for (const [part, sliders] of parts) {
    const rows = sliders.map(slider => makeSlider(slider, setup.sliders.indexOf(slider))).filter(Boolean);
    if (!rows.length) continue;
    const [group, heading] = ["details", "summary"].map(name => document.createElement(name));
    group.open = setup.sliders.length <= 24 || Boolean(precomputed);
    heading.textContent = part;
    group.append(heading, ...rows);
    byId("values").append(group);
  }
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
  stage.update(t, curves, answer.phases, name => values.get(name), playRate());
  byId("scale").textContent = stage.scale;
  showTime();
  updates = [...updates.filter(then => then > start - 1000), start];
  const { simulate, read: reading } = answer.milliseconds;
  const rate = updates.length > 1 ? `, ${updates.length} updates in the last second` : "";
  const computed = precomputed ? "Computed before" : `Simulated in ${simulate.toFixed(1)} ms, read in ${reading.toFixed(1)} ms`;
  const warned = answer.warnings.length ? ` ${answer.warnings.join(" ")}` : "";
  byId("state").textContent = `${computed}, drawn in ${(performance.now() - start).toFixed(0)} ms${rate}.${warned}`;
}

function showPhases() {
  byId("phases").hidden = !shown.phases.length;
  const rows = shown.phases.map(row => [row.start, row.end, Object.entries(row.modes).map(([part, mode]) => `${part} ${mode}`).join(", ")]);
  fill("phases", rows);
}

function showExtremes() {
  const place = placeOf(shown.t, time());
  const rows = setup.axes.flatMap(axis =>
    axis.signals.map(name => {
      const row = extremes.find(one => one.name === name);
      const ends = row ? [row.min, row.t_min, row.max, row.t_max] : sampled(shown.curves[name]);
      return [name, axis.unit, read(shown.curves[name], place), ...ends];
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

/** Seconds of the motion that one second plays: at least 4 and at most 12 seconds are played. */
function playRate() {
  const length = shown.t.at(-1) - shown.t[0];
  return length / Math.min(12, Math.max(4, length));
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
  const { set: changes, t_end: end } = request([]);
  byId("state").textContent = `${name} is being written.`;
  const response = await fetch(`/files/${name}`, { method: "POST", body: JSON.stringify({ set: changes, t_end: end }) });
  if (!response.ok) return say(await response.text());
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await response.blob());
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
  byId("state").textContent = `${name} is saved.`;
  return undefined;
}

function start() {
  byId("source").textContent = setup.source;
  byId("end").value = printed(setup.t_end);
  makeSliders();
  makeLegend();
  byId("end").addEventListener("change", follow);
  byId("tools").addEventListener("submit", event => event.preventDefault());
  byId("reset").addEventListener("click", () => {
    for (const slider of setup.sliders) if (controls.has(slider.name)) set(slider, slider.value);
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
