"use strict";
// The live page of an experiment: asks ten times a second for the samples that are new.
const EVERY_MS = 100, LOG2 = Math.log(2);
let run = 0, have = 0, kept = null, plots = {};

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
    const state = await ask(`state?run=${run}&since=${have}`);
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
  const words = {running: "The run goes on.", resting: "The specimen rests before the run.", diagnosing: "The recordings are being diagnosed.", ended: `The experiment has ended. ${status.sentence || ""}`};
  const done = [...state.runs].reverse().find(one => one.verdict);
  $("doing").textContent = `${state.stopping ? "Stopping. " : ""}${words[status.doing] || ""} ${done ? done.sentence : ""}`;
  $("vent").disabled = status.doing === "ended";
  if (state.run) curves(state.run);
  table(state.runs); probabilities(done);
}

function curves(now) {
  if (now.number !== run || now.count < have) { run = now.number; have = 0; kept = {time: [], series: {}, expected: now.expected || {}}; plots = {}; $("plots").replaceChildren(); }
  if (now.expected) kept.expected = now.expected;
  kept.time.push(...now.time_s);
  for (const [name, values] of Object.entries(now.series)) (kept.series[name] = kept.series[name] || []).push(...values);
  have = kept.time.length;
  for (const name of new Set([...Object.keys(kept.expected), ...Object.keys(kept.series)])) draw(name, now);
}

function draw(name, now) {
  const axis = now.axes[name] || {label: name, unit: ""}, future = kept.expected[name];
  const [x, measured, mean, low, high] = joined(future, kept.time, kept.series[name] || []);
  const rows = [x, measured, mean, low, high];
  if (!plots[name]) {
    const width = $("plots").clientWidth || 900, label = axis.unit ? `${axis.label} (${axis.unit})` : axis.label;
    plots[name] = new uPlot({width, height: 230, cursor: {show: true}, legend: {show: false}, scales: {x: {time: false, range: [0, Math.max(now.duration_s, 1e-6)]}},
      axes: [{label: "time (s)"}, {label, size: 70}], bands: now.inputs.includes(name) ? [] : [{series: [4, 3], fill: "#0072b222"}],
      series: [{}, {label: "measured", stroke: "#1d2433", width: 1.4, spanGaps: true}, {label: "expected", stroke: "#0072b2", width: 1.2, spanGaps: true},
        {label: "low", stroke: "#0072b255", width: 0.5, spanGaps: true}, {label: "high", stroke: "#0072b255", width: 0.5, spanGaps: true}]}, rows, $("plots"));
  } else plots[name].setData(rows);
}

// Measured and expected values have clocks of their own; a chart has one.
function joined(future, time, values) {
  const all = [...(future ? future.time_s.map((t, k) => [t, null, future.mean[k], future.mean[k] == null ? null : future.mean[k] - 2 * future.sd[k],
    future.mean[k] == null ? null : future.mean[k] + 2 * future.sd[k]]) : []), ...time.map((t, k) => [t, values[k] ?? null, null, null, null])];
  all.sort((a, b) => a[0] - b[0]);
  return [0, 1, 2, 3, 4].map(k => all.map(row => row[k]));
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
