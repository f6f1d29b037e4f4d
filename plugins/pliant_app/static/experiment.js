"use strict";
// The live page of an experiment: asks ten times a second for the samples that are new.
const EVERY_MS = 100, LOG2 = Math.log(2);
let run = 0, have = 0, models = -1, kept = null, plots = {};

function el(tag, attributes, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes || {})) made.setAttribute(key, value);
  made.append(...children.map(child => child ?? ""));
  return made;
}
const bits = nats => nats == null ? "–" : `${(nats / LOG2).toFixed(2)} bit`;
const named = kinds => kinds.join(" + ") || "nothing missing";

async function beat() {
  try {
    const state = await ask(`state?run=${run}&since=${have}&models=${models}`);
    show(state);
    if ($("said").dataset.lost) { delete $("said").dataset.lost; say(""); }
  } catch (error) {
    say(error.message.startsWith("Refused") ? error.message : "The page's server does not answer. The experiment goes on without it.");
    $("said").dataset.lost = "1";
  }
  setTimeout(beat, EVERY_MS);
}

function show(state) {
  const last = state.runs[state.runs.length - 1], status = state.status || {};
  $("title").textContent = last ? last.name : "No run yet";
  $("why").textContent = last ? `${last.words}. ${last.why}` : "";
  const words = {running: "The run goes on.", resting: "The specimen rests before the run.", diagnosing: "The recordings are being diagnosed.", planning: "The next run is being chosen.", improving: "The model is being improved with all recordings.", reconnecting: "The connection was lost; it is being opened again.", ended: `The experiment has ended. ${status.sentence || ""}`};
  const done = [...state.runs].reverse().find(one => one.verdict);
  $("doing").textContent = `${state.stopping ? "Stopping. " : ""}${words[status.doing] || ""} ${done ? done.sentence : ""}`;
  $("fits").textContent = status.words ? `${status.words}.` : "";
  $("progress").hidden = status.share == null; $("progress").value = status.share ?? 0;
  $("vent").disabled = status.doing === "ended";
  if (state.run) curves(state.run);
  table(state.runs); probabilities(done);
}

function curves(now) {
  if (now.number !== run || now.count < have) { run = now.number; have = 0; models = -1; kept = {time: [], series: {}, models: {}}; clear(); }
  kept.time.push(...now.time_s);
  for (const [name, values] of Object.entries(now.series)) (kept.series[name] = kept.series[name] || []).push(...values);
  have = kept.time.length;
  if (now.models) { models = now.models.number; kept.models = now.models.outputs; clear(); key(); }
  for (const name of new Set([...Object.keys(kept.models), ...Object.keys(kept.series)])) draw(name, now);
}

function clear() { plots = {}; $("plots").replaceChildren(); }

// The model as it is, and with the explanation.
const COLOURS = ["#d55e00", "#0072b2"];
function key() {
  const named = Object.values(kept.models)[0] || [], when = models > 0 ? `after the diagnosis of run ${models}` : "expected before the run";
  $("key").replaceChildren(el("span", {class: "key measured"}), " measured", ...named.flatMap((one, k) => [el("span", {class: "key", style: `background:${COLOURS[k]}`}),
    ` ${one.name}${one.sd.some(sd => sd != null) ? " ± 2 sd" : ""}`]), el("span", {class: "soft"}, named.length ? ` (${when})` : ""));
}

function draw(name, now) {
  const axis = now.axes[name] || {label: name, unit: ""}, shown = now.inputs.includes(name) ? [] : kept.models[name] || [];
  const label = axis.unit ? `${axis.label} (${axis.unit})` : axis.label, values = kept.series[name] || [];
  plot(name, joined(shown, kept.time, values), shown, {label, height: 230, now});
  if (shown.length) plot(`${name} residual`, residuals(shown, kept.time, values), shown, {label: `error${axis.unit ? ` (${axis.unit})` : ""}`, height: 190, now, is_residual: true});
}

// Columns: time, measured, then of each model its mean (of a residual: what it misses), low and high.
function plot(id, rows, shown, {label, height, now, is_residual}) {
  if (plots[id]) { plots[id].setData(rows); return; }
  const width = $("plots").clientWidth || 900, thin = {width: 0.5, spanGaps: true}, dots = {show: true, size: 3};
  const series = [{}, is_residual ? {stroke: "#5c6577", width: 1, spanGaps: true} : {stroke: "#1d2433", width: 1.4, spanGaps: true}], bands = [];
  shown.forEach((one, k) => {
    const at = series.length, colour = COLOURS[k];
    series.push({stroke: colour, width: is_residual ? 0 : 1.4, spanGaps: true, points: is_residual ? {...dots, stroke: colour, fill: colour} : {show: false}},
      {stroke: `${colour}55`, points: {show: false}, ...thin}, {stroke: `${colour}55`, points: {show: false}, ...thin});
    bands.push({series: [at + 2, at + 1], fill: `${colour}2e`});
  });
  plots[id] = new uPlot({width, height, cursor: {show: true}, legend: {show: false}, scales: {x: {time: false, range: [0, Math.max(now.duration_s, 1e-6)]}},
    axes: [{label: "time (s)"}, {label, size: 70}], bands, series}, rows, $("plots"));
}

// Measured and expected values have clocks of their own; a chart has one.
function joined(shown, time, values) {
  const wide = 2 + 3 * shown.length, rows = time.map((t, k) => { const row = Array(wide).fill(null); row[0] = t; row[1] = values[k] ?? null; return row; });
  shown.forEach((one, m) => one.time_s.forEach((t, k) => {
    const row = Array(wide).fill(null), at = 2 + 3 * m, mean = one.mean[k], sd = one.sd[k];
    row[0] = t; row[at] = mean;
    if (mean != null && sd != null) { row[at + 1] = mean - 2 * sd; row[at + 2] = mean + 2 * sd; }
    rows.push(row);
  }));
  return columns(rows, wide);
}

function residuals(shown, time, values) {
  const wide = 2 + 3 * shown.length;
  return columns(time.map((t, k) => {
    const row = Array(wide).fill(null); row[0] = t; row[1] = 0;
    shown.forEach((one, m) => {
      const mean = at(one.time_s, one.mean, t), sd = at(one.time_s, one.sd, t), first = 2 + 3 * m;
      if (mean != null && values[k] != null) row[first] = values[k] - mean;
      if (sd != null) { row[first + 1] = -2 * sd; row[first + 2] = 2 * sd; }
    });
    return row;
  }), wide);
}

function columns(rows, wide) {
  rows.sort((a, b) => a[0] - b[0]);
  return Array.from({length: wide}, (_, k) => rows.map(row => row[k]));
}

// The value of a model at a time, linear between its samples; null outside them.
function at(clock, values, t) {
  let low = 0, high = clock.length - 1;
  if (high < 0 || t < clock[0] - 1e-9 || t > clock[high] + 1e-9) return null;
  while (high - low > 1) { const middle = (low + high) >> 1; if (clock[middle] <= t) low = middle; else high = middle; }
  const a = values[low], b = values[high];
  if (a == null || b == null) return null;
  return clock[high] > clock[low] ? a + (b - a) * Math.min(Math.max((t - clock[low]) / (clock[high] - clock[low]), 0), 1) : a;
}

function table(runs) {
  $("runs").replaceChildren(...runs.map(one => el("tr", {}, el("td", {class: "n"}, String(one.number)), el("td", {}, one.words, el("div", {class: "soft"}, one.reason || one.why || "")),
    el("td", {class: "n"}, one.minutes == null ? "–" : one.minutes.toPrecision(2)), el("td", {class: "n"}, bits(one.expected_nats)), el("td", {class: "n"}, bits(one.obtained_nats)),
    el("td", {}, one.sentence || (one.ending ? "–" : "goes on")))));
}

function probabilities(done) {
  if (!done) { $("probabilities").replaceChildren(el("p", {class: "soft"}, "They come after the first repeats.")); return; }
  $("probabilities").replaceChildren(el("table", {}, ...done.hypotheses.map(one => el("tr", {}, el("td", {}, named(one.kinds)),
    el("td", {class: "n"}, `${(100 * one.probability).toFixed(1)} %`), el("td", {}, el("progress", {max: "1", value: String(one.probability), "aria-label": named(one.kinds)}))))));
}

$("vent").addEventListener("click", async () => { try { await ask("vent", {}); } catch (error) { say(error.message); } });
beat();
