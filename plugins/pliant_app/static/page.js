"use strict";
// The page: asks the server, draws, sends choices. The state is the server's; every tab sees the same.
let view = null, data = null, version = -1, now = null, asis = null, where = null, screening = null, marked = null, curvesOf = "";
let dropping = false;  // files that come together are looked at together

const attempt = work => async (...args) => { try { say(""); await work(...args); } catch (error) { say(error.message); } };

// What is there
async function pulse() {
  try {
    const beat = await ask("pulse");
    job(beat.job);
    if (beat.version !== version && !dropping) { version = beat.version; await load(beat.study); }
    if ($("said").dataset.lost) { delete $("said").dataset.lost; say(""); }
  } catch (error) {
    say(error.message.startsWith("Refused") ? error.message : "The server does not answer. Everything is saved: start 'pliant app' again and this page goes on.");
    $("said").dataset.lost = "1";
  }
  setTimeout(pulse, 700);
}
let loads = 0;  // the newest one alone draws: an older answer may come later
async function load(study) {
  const mine = ++loads, older = () => mine !== loads;
  if (!view || study !== view.study) opening(study ? `Opening ${study}: its recording is read and predicted; at the first use on a machine the model is compiled, which takes half a minute or more.` : "Asking the server …");
  const seen = await ask("view"); if (older()) return;
  view = seen;
  $("begin").hidden = !!view.model; $("bench").hidden = !view.model;
  if (view.said.length && view.said.join("\n") !== load.said) { load.said = view.said.join("\n"); say(view.said[view.said.length - 1]); }
  for (const id of ["undo", "redo", "yaml", "save", "keep", "report"]) $(id).disabled = !view.model;
  if (!view.model) { opening(""); begin(); return; }
  const m = view.model, key = JSON.stringify([view.study, view.data, m.name, m.off]);
  $("title").textContent = m.name; $("source").textContent = `${view.study} · ${m.source} · ${view.folder}`;
  if (key !== curvesOf) { const curves = await ask("curves"); if (older()) return; data = decode(curves); curvesOf = key; marked = null; choices(); }
  await preview(m.effects, 0, true, older); if (older()) return;
  await besides(m, key); if (older()) return;
  opening(""); document.body.classList.add("working"); tables(); draw(); effects.show(m, screening && screening.found, true);
  const at = version;
  await space(); if (older()) return;
  const places = await ask("where"); if (older()) return;
  where = places; document.body.classList.remove("working"); if (at === version) { sentence(); tables(); }
  const found = await ask("screen"); if (older()) return;
  screening = {of: at, found};
  if (at === version) { effects.show(m, found); silent(found); document.body.dataset.ready = at; }
}

function opening(words) { $("openingwords").textContent = words; $("opening").hidden = !words; }

// The model beside the present one: a step of the history, the first one until another is chosen.
async function besides(m, key) {
  const names = m.steps.map((s, k) => ({name: String(k), label: `${k + 1}. ${s.words}`})).filter(s => +s.name !== m.cursor);
  fill($("beside"), [{name: "", label: "nothing"}, ...names]);
  if ($("beside").dataset.chosen === undefined && m.cursor > 0) $("beside").value = "0";
  const k = $("beside").value;
  if (k === "") { asis = null; return; }
  const of = key + JSON.stringify(m.steps[+k].effects);
  if (asis === null || asis.of !== of) asis = {of, predicted: unpack((await ask("preview", {effects: m.steps[+k].effects})).predicted)};
  asis.words = m.steps[+k].words;
}
// The robot through a run, where the reader has opened it; what is looked at stays while effects change.
async function space() {
  if (!$("space").open || !view || !view.model) return;
  const hold = $("robotview"), names = data.runs.map(run => ({name: run.name, label: `${run.name}${run.aside ? " (held out)" : ""}`}));
  fill($("spacerun"), names, names[0].name);
  const run = $("spacerun").value, of = curvesOf + run;
  let found; try { found = await ask("space", {effects: view.model.effects, run}); $("spacesaid").textContent = ""; }
  catch (error) { hold.replaceChildren(); delete hold.scene; $("spacesaid").textContent = error.message; return; }
  const colours = JSON.stringify(found.colourings.map(one => one.name));
  if (hold.scene && hold.dataset.of === of && hold.dataset.colours === colours) { hold.scene.retake(found); return; }
  const was = hold.dataset.of === of ? hold.scene : null;
  hold.replaceChildren(); hold.dataset.of = of; hold.dataset.colours = colours; hold.scene = new PliantParts.Scene(hold, found);
  if (was) { was.pause(); Object.assign(hold.scene, {turned: was.turned, zoomed: was.zoomed}); hold.scene.show(was.state); }
}
function decode(curves) {
  curves.n = curves.time.length; curves.run = []; curves.starts = [];
  curves.runs.forEach((run, k) => { curves.starts.push(curves.run.length); for (let i = 0; i < run.points; i++) curves.run.push(k); });
  return curves;
}
function unpack(texts) {
  const found = {};
  for (const [name, text] of Object.entries(texts)) {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
    found[name] = new Float32Array(bytes.buffer);
  }
  return found;
}
let flying = false, waiting = null;
async function preview(effects, parts, settled, older = () => false) {
  if (flying && !settled) { waiting = [effects, parts]; return; }
  flying = true;
  try {
    const found = await ask("preview", {effects, parts}); if (older()) return;
    now = {...found, predicted: unpack(found.predicted)};
  } finally { flying = false; }
  if (waiting && !settled) { const [e, p] = waiting; waiting = null; await preview(e, p, false); }
}

// Begin
function begin() {
  const r = view.recording, hold = $("recording"); hold.replaceChildren();
  $("title").textContent = view.study || view.data.join(", ") || "Drop a recording and a study";
  if (view.refused) hold.append(el("p", {class: "warning"}, view.refused));
  if (view.data.length) hold.append(el("p", {}, ...view.data.flatMap(name => [`${name} `,
    el("button", {type: "button", onclick: attempt(async () => { await ask("forget", {name}); await beat(); })}, "Leave it out"), " "])));
  if (!r) return;
  if (r.refused) { hold.append(el("pre", {}, r.refused)); return; }
  hold.append(el("p", {class: "result"}, r.sentence), ...r.doubts.map(d => el("p", {class: "warning"}, d)),
    el("table", {}, el("tr", {}, ...["in the file", "unit", "read as"].map(t => el("th", {}, t))),
      ...r.columns.map(c => el("tr", {}, el("td", {}, c.heading || ""), el("td", {}, c.unit || ""), el("td", {}, c.name || "")))),
    el("p", {}, "Now drop the study of this robot (.yaml), or describe it below; 'pliant import FILE --out NEW.yaml' writes one to fill in."));
}

// Pictures
const words = k => { const o = output(), run = data.runs[data.run[k]];
  const p = now.predicted[o.name][k];
  return `${run.name}${run.aside ? " (held out)" : ""}  ${data.time_label.split(" (")[0].split(",")[0]} ${short(data.time[k])}\nmeasured ${short(o.measured[k])} ${o.unit}\nmodel ${short(p)} ${o.unit}\nerror ${short(o.measured[k] - p)} ${o.unit}`; };
const brush = test => {
  if (!test) { marked = null; } else {
    marked = new Uint8Array(data.n); const on = visible();
    for (let k = 0; k < data.n; k++) marked[k] = on[k] && test(k) ? 1 : 0;
  }
  share(); draw();
};
const pictures = {time: new Picture($("time"), 290, brush, words), loops: new Picture($("loops"), 270, brush, words),
  residual: new Picture($("residual"), 270, brush, words)};
const output = () => data.outputs.find(o => o.name === $("output").value) || data.outputs[0];
const circumstance = id => data.circumstances.find(c => c.name === $(id).value) || data.circumstances[0];
function visible() {
  const see = $("seeaside").checked, on = new Uint8Array(data.n);
  for (let k = 0; k < data.n; k++) { const r = data.runs[data.run[k]]; on[k] = !r.off && (see || !r.aside) ? 1 : 0; }
  return on;
}
function fill(select, items, keep) {
  const was = select.value; select.replaceChildren(...items.map(i => el("option", {value: i.name}, i.label)));
  select.value = items.some(i => i.name === was) ? was : (keep && items.some(i => i.name === keep) ? keep : (items[0] || {}).name);
}
function choices() {
  fill($("output"), data.outputs);
  const driving = data.circumstances.filter(c => !c.categories.length);
  fill($("over"), driving); fill($("against"), data.circumstances, (data.circumstances.find(c => !c.drives) || {}).name);
}
// Time without the runs that are not shown, and where each run begins.
function compact() {
  const see = $("seeaside").checked, clock = data.time.slice(), rules = [];
  let shift = 0;
  data.runs.forEach((run, k) => {
    const first = data.starts[k], last = (k + 1 < data.runs.length ? data.starts[k + 1] : data.n) - 1;
    const end = k + 1 < data.runs.length ? data.time[data.starts[k + 1]] : data.time[last];
    if (run.off || (run.aside && !see)) { shift += end - data.time[first]; return; }
    for (let i = first; i <= last; i++) clock[i] = data.time[i] === null ? null : data.time[i] - shift;
    rules.push({at: data.time[first] - shift, width: end - data.time[first], text: run.name});
  });
  return [clock, rules];
}
// Categories side by side, points spread a little so that each is seen.
const spread = c => c.categories.length ? c.values.map((v, k) => v === null ? null : v + 0.5 * (((k * 0.618034) % 1) - 0.5)) : c.values;
// after: "show" where anything may have changed, "move" where the model alone did.
function draw(after = "show") {
  if (!data || !now) return;
  const o = output(), p = now.predicted[o.name], base = asis && asis.predicted[o.name].length === data.n ? asis.predicted[o.name] : null;
  const on = visible(), faint = data.run.map(k => data.runs[k].aside), floor = now.floors[o.name] || 0;
  const lines = [...(base ? [{values: base, colour: PLAIN, width: 1.4}] : []), {values: p, colour: MODEL}];
  const common = {of: curvesOf + $("seeaside").checked, on, faint, marked, starts: data.starts, lines};
  const [clock, rules] = compact();
  pictures.time[after]({...common, x: clock, y: o.measured, rules, xlabel: data.time_label, ylabel: o.axis, name: `${o.label} over time, measured and model`});
  const over = circumstance("over");
  if (over) pictures.loops[after]({...common, x: over.values, y: o.measured, xlabel: over.axis, ylabel: o.axis, name: `${o.label} over ${over.label}`});
  const against = circumstance("against"), rest = o.measured.map((v, k) => v === null || p[k] !== p[k] ? null : v - p[k]);
  const unit = o.unit ? ` (${o.unit})` : "";
  pictures.residual[after]({...common, lines: [], moving: true, x: spread(against), y: rest, band: 2 * floor, categories: against.categories,
    xlabel: against.axis, ylabel: `measured − model${unit}`, name: `error of ${o.label} over ${against.label}`});
  $("besidename").textContent = asis ? asis.words : ""; $("besidename").previousElementSibling.style.display = asis ? "" : "none";
  if (after === "show") conditionMap(o, p, floor, on, against);
  $("floor").textContent = floor ? `; one is ${short(floor)} ${o.unit}, from ${now.floor_from[o.name]}` : "; no floor is known here";
}
// Rms error of each run over the noise, in each part of a circumstance: white is noise, red more, blue less.
function conditionMap(o, p, floor, on, c) {
  const known = c.values.filter((v, k) => on[k] && v !== null), low = known.reduce((a, b) => Math.min(a, b), Infinity), high = known.reduce((a, b) => Math.max(a, b), -Infinity);
  const parts = c.categories.length || (high > low ? 6 : 1), at = v => c.categories.length ? v : Math.min(parts - 1, Math.floor((v - low) / ((high - low) || 1) * parts));
  const heads = c.categories.length ? c.categories : Array.from({length: parts}, (_, j) => `${short(low + (j + 0.5) * (high - low) / parts)} ${c.unit}`);
  const sums = data.runs.map(() => Array.from({length: parts}, () => [0, 0])), scale = floor || 1;
  for (let k = 0; k < data.n; k++) { if (!on[k] || c.values[k] === null || o.measured[k] === null || p[k] !== p[k]) continue;
    const cell = sums[data.run[k]][at(c.values[k])]; cell[0] += ((o.measured[k] - p[k]) / scale) ** 2; cell[1]++; }
  const look = r => { const s = Math.min(1, Math.abs(Math.log2(r)) / 3), to = r > 1 ? [213, 94, 0] : [0, 114, 178];
    return `background: rgb(${to.map(v => Math.round(255 + 0.62 * s * (v - 255))).join(" ")})`; };
  const cell = (run, j) => { const [sum, n] = sums[run][j]; if (!n) return el("td", {class: "n soft"}, "–");
    const r = Math.sqrt(sum / n), name = data.runs[run].name;
    return el("td", {class: "n", style: floor ? look(r) : ""}, el("button", {type: "button", class: "cell", "aria-label": `mark ${name}, ${heads[j]}: ${r.toFixed(2)}`,
      onclick: () => brush(k => data.run[k] === run && c.values[k] !== null && at(c.values[k]) === j)}, floor ? r.toFixed(1) : short(r))); };
  $("map").replaceChildren(el("tr", {}, el("th", {}, c.label), ...heads.map(h => el("th", {class: "n"}, h))),
    ...data.runs.map((run, k) => [run, k]).filter(([, k]) => sums[k].some(([, n]) => n)).map(([run, k]) => el("tr", {}, el("td", {}, run.name), ...heads.map((_, j) => cell(k, j)))));
}
function share() {
  if (!marked) { $("brushed").textContent = ""; return; }
  let all = 0, mine = 0, count = 0, of = 0;
  const on = visible();
  for (const o of data.outputs) {
    const p = now.predicted[o.name], floor = now.floors[o.name] || 1;
    for (let k = 0; k < data.n; k++) {
      if (!on[k] || data.runs[data.run[k]].aside || o.measured[k] === null || p[k] !== p[k]) continue;
      const q = ((o.measured[k] - p[k]) / floor) ** 2; all += q; of++;
      if (marked[k]) { mine += q; count++; }
    }
  }
  $("brushed").textContent = of ? `marked: ${percent(count / of)} of the readings, ${percent(mine / (all || 1))} of the squared error` : "";
}

// Tables and words
function sentence() { $("sentence").textContent = where ? where.sentence : ""; }
function tables() {
  const m = view.model, ratio = where ? where.runs : {};
  $("aside").textContent = m.aside;
  const of = data.runs.map(run => run.name).join("\n");
  if ($("runs").of !== of) {  // rows stay while they are clicked
    $("runs").of = of;
    $("runs").replaceChildren(el("tr", {}, ...["on", "run", "condition", "error / noise"].map((t, k) => el("th", {class: k === 3 ? "n" : ""}, t))),
      ...data.runs.map(({name}) => el("tr", {}, el("td", {}, el("input", {type: "checkbox", "aria-label": `run ${name}`, onchange: attempt(event => toggle(name, event.target.checked))})),
        el("td", {}, name), el("td", {}), el("td", {class: "n"}))));
  }
  const worst = Math.max(0, ...data.runs.filter(run => !run.off && !run.aside).map(run => ratio[run.name] || 0));
  data.runs.forEach((run, k) => { const row = $("runs").rows[k + 1], off = toggled.has(run.name) ? !toggled.get(run.name) : run.off;
    row.className = run.aside ? "asiderow" : ""; row.cells[0].firstChild.checked = !off; row.cells[2].textContent = run.words;
    row.cells[3].textContent = off ? "off" : run.aside ? "held out" : ratio[run.name] ? `${ratio[run.name] === worst ? "worst: " : ""}${ratio[run.name].toFixed(2)}` : "–"; });
  if (where) {
    $("places").replaceChildren(el("tr", {}, el("th", {}, "condition"), el("th", {class: "n"}, "of error"), el("th", {class: "n"}, "of readings")),
      ...where.places.slice(0, 7).map(p => el("tr", {}, el("td", {}, p.condition), el("td", {class: "n"}, percent(p.share)), el("td", {class: "n"}, percent(p.readings)))));
    $("depends").replaceChildren(...where.depends_on.filter(d => d.share > 0.02).map(d => el("tr", {}, el("td", {}, d.words), el("td", {class: "n"}, percent(d.share)))));
  }
  for (const id of ["doubts", "study_doubts"]) {
    $(id).hidden = !m[id].length;
    $(id).querySelector("ul").replaceChildren(...m[id].map(d => el("li", {}, d)));
  }
  stairs($("stairs"), m.steps, m.cursor);
  const text = v => v === null ? "–" : v.toFixed(2);
  $("history").replaceChildren(...m.steps.map((s, k) => el("li", {class: k === m.cursor ? "now" : k > m.cursor ? "undone" : ""},
    el("button", {type: "button", onclick: attempt(() => ask("go", {cursor: k}))}, s.words), " ",
    el("span", {class: "soft"}, s.aside === null ? `${text(s.error)} on the runs it sees; none is held out` : `${text(s.aside)} on runs held out, ${text(s.error)} ${s.fitted ? "fitted" : "on the others"}`))));
  $("warnings").replaceChildren(...m.warnings.map(w => el("p", {class: "warning"}, w)));
  $("undo").disabled = m.cursor === 0; $("redo").disabled = m.cursor >= m.steps.length - 1;
  $("fit").disabled = !m.effects.length;
  verdict(m);
}
function verdict(m) {
  const hold = $("verdict"), d = m.diagnosis, f = m.fit; hold.replaceChildren();
  const link = (name, text) => el("a", {href: `/result/${name}?token=${encodeURIComponent(token)}`, target: "_blank", rel: "noopener"}, text);
  if (f && f.what === "improve") {
    hold.append(el("p", {class: "result"}, f.sentence), f.sentence.includes(f.reason) ? "" : el("p", {class: "soft"}, f.reason),
      el("table", {}, el("tr", {}, el("th", {}, "step of improve"), el("th", {class: "n"}, "held out"), el("th", {class: "n"}, "left out")),
        ...f.steps.map(s => el("tr", {}, el("td", {}, s.words), el("td", {class: "n"}, s.aside === null ? "–" : `${s.aside.toFixed(2)} ± ${s.se.toFixed(2)}`), el("td", {class: "n"}, s.training.toFixed(2))))));
    if (f.learned) {
      hold.append(el("p", {}, f.learned.words));
      if (f.learned.curve) { const ns = "http://www.w3.org/2000/svg", svg = document.createElementNS(ns, "svg"); svg.setAttribute("class", "learned"); svg.setAttribute("role", "img"); hold.append(svg); learnedCurve(svg, f.learned.curve); }
    }
    if (f.report) hold.append(el("p", {}, link(f.report, "The report of Improve")));
  }
  if (d) hold.append(...diagnosed(d, link));
  else if (m.earlier) hold.append(el("div", {class: "earlier"}, el("p", {class: "soft"}, `The diagnosis of step ${m.earlier.step + 1}, ${m.earlier.words}:`), ...diagnosed(m.earlier.found, link)));
}
// A diagnosis: what it says, the best explanations and their rivals, the next run, what else would distinguish look-alikes.
function diagnosed(d, link) {
  const parts = [el("p", {class: "result"}, d.sentence)], name = h => h.kinds.map(kind => ((d.had || []).includes(kind) ? `more of ${kind}` : kind)).join(" + ").replaceAll("_", " ") || "nothing is missing";
  const probable = d.hypotheses.filter((h, k) => h.kinds.length && (k === 0 || h.probability > 0.01)).slice(0, 5), known = new Set(probable.map(name));
  const rivals = Object.entries(d.single).map(([kind, one]) => ({kinds: [kind], ...one})).filter(h => !known.has(name(h)) && Number.isFinite(h.left_out))
    .sort((a, b) => a.left_out - b.left_out).slice(0, Math.max(0, 5 - probable.length));
  const nothing = {kinds: [], left_out: d.nothing, probability: (d.hypotheses.find(h => !h.kinds.length) || {probability: 0}).probability};
  const rows = d.hypotheses[0].kinds.length ? [...probable, ...rivals, nothing] : [nothing, ...probable, ...rivals];
  parts.push(el("table", {}, el("tr", {}, el("th", {}, "explanation"), el("th", {class: "n"}, "probability"), el("th", {class: "n"}, "left-out error / noise")),
    ...rows.map(h => el("tr", {}, el("td", {}, name(h)), el("td", {class: "n"}, chance(h.probability)), el("td", {class: "n"}, h.left_out === null ? "–" : h.left_out.toFixed(2))))));
  const sure = Object.entries(d.by_kind).filter(([, p]) => p > 0.9);
  if (sure.length && d.verdict !== "missing_effect") parts.push(el("p", {}, `In nearly every explanation: ${sure.map(([kind, p]) => `${kind.replaceAll("_", " ")} (${chance(p)})`).join(", ")}.`));
  if (d.asked) parts.push(el("p", {class: "soft"}, d.asked));
  if (d.next_run && d.verdict !== "missing_effect") parts.push(el("p", {}, `Next: ${d.next_run}`));
  else if (d.next_run) parts.push(el("p", {class: "soft"}, `These runs decide. To be surer still: ${d.next_run}`));
  else parts.push(el("p", {class: "soft"}, /^(missing_effect|nothing_missing)$/.test(d.verdict)
    ? "These runs decide: no further run is proposed." : "No run that can be proposed would decide more."));
  const links = [...(d.protocol ? [link(d.protocol, "The file of the next run")] : []), ...(d.report ? [link(d.report, "The report of Diagnose")] : [])];
  if (links.length) parts.push(el("p", {}, links[0], links[1] ? " · " : "", links[1]));
  if (d.protocol) parts.push(el("p", {class: "soft"}, "Do it, fill in the readings, and add the file here: it goes beside the runs that are there."));
  const others = d.classes.filter(c => c.run && c.run !== d.next_name);
  if (others.length) parts.push(el("details", {}, el("summary", {}, "Runs that would distinguish look-alikes"), el("table", {}, el("tr", {}, el("th", {}, "run"), el("th", {class: "n"}, "min"), el("th", {}, "distinguishes")),
    ...others.map(c => el("tr", {}, el("td", {}, c.words), el("td", {class: "n"}, short(c.minutes)), el("td", {}, c.kinds.join(", ").replaceAll("_", " ")))))));
  return parts;
}
function silent(found) {
  const quiet = view.model.catalogue.filter(c => found.kinds[c.kind] && !found.kinds[c.kind].shown);
  const out = Object.entries(found.left_out);
  $("silent").hidden = !(quiet.length + out.length);
  $("silent").querySelector("summary").textContent = `${quiet.length} effects these runs could not show, ${out.length} this model cannot have`;
  $("silent").querySelector("ul").replaceChildren(
    ...quiet.map(c => el("li", {}, `${c.kind.replaceAll("_", " ")}. `, found.kinds[c.kind].excited_by)), ...out.map(([, why]) => el("li", {}, why)));
}
function job(running) {
  $("job").hidden = !running;
  for (const id of ["fit", "diagnose", "improve"]) $(id).disabled = !!running || (id === "fit" && !(view && view.model && view.model.effects.length));
  if (running) $("jobwords").textContent = `${running.what}${running.done ? `, ${running.done} fits` : ""}, ${Math.round(running.seconds)} s ${running.stopping ? "· stopping" : running.words ? `· ${running.words}` : ""}`;
}

// What is done
const robot = new RobotForm($("robot"), $("ways"), $("blocks"), attempt(async values => { await ask("describe", values); await beat(); }));
$("describe").addEventListener("toggle", attempt(async () => { if ($("describe").open) robot.show(await ask("form")); }));
const effects = new EffectList($("effects"),
  effects => preview(effects, now ? now.parts : 0, false).then(() => { draw("move"); share(); }).catch(error => say(error.message)),
  attempt(async (effects, words) => { effectsBusy(false); await ask("step", {effects, off: view.model.off, words}); await beat(); }),
  attempt(async (kind, on) => { try { await ask("tick", {kind, on}); } finally { await beat(); } }));
function effectsBusy(busy) { effects.busy = busy; }
async function beat() { const b = await ask("pulse"); job(b.job); if (b.version !== version) { version = b.version; await load(b.study); } }
const toggled = new Map();  // runs whose switch the server has not heard of yet
let switching = Promise.resolve();  // one after the other, in the order of the clicks
async function toggle(run, on) {
  toggled.set(run, on);
  switching = switching.catch(() => null).then(() => ask("toggle", {run, on}));
  try { await switching; } catch (error) { if (data) tables(); throw error; } finally { if (toggled.get(run) === on) toggled.delete(run); await beat(); if (data) tables(); }
}
async function upload(files) {
  dropping = true;
  try { await send(files); } finally { dropping = false; }
  say(""); asis = null; await beat();
}
async function send(files) {
  const order = [...files].sort((a, b) => /\.ya?ml$/i.test(a.name) - /\.ya?ml$/i.test(b.name));
  const large = order.find(file => view && file.size > view.most.bytes);  // a browser may lose the answer to what it still sends
  if (large) throw new Error(`${large.name}: ${view.most.sentence}`);
  for (const file of order) {
    say(`reading ${file.name} …`);
    const answer = await fetch(`/api/upload?name=${encodeURIComponent(file.name)}`, {method: "POST", headers, body: file});
    const found = await answer.json(); if (!answer.ok) throw new Error(found.error);
  }
}
function dialog(title, text, links) {
  $("dialogtitle").textContent = title; $("dialogtext").textContent = text; $("dialoglinks").replaceChildren(...links); $("dialog").showModal();
}
const go = (id, work) => $(id).addEventListener("click", attempt(work));
go("undo", async () => { await ask("go", {cursor: view.model.cursor - 1}); await beat(); });
go("redo", async () => { await ask("go", {cursor: view.model.cursor + 1}); await beat(); });
for (const what of ["diagnose", "improve"]) go(what, async () => { await ask("run", {what, learned: what === "improve" && $("learned").checked}); await beat(); });
go("fit", async () => { const known = new Set(view.model.catalogue.map(c => c.kind)), kinds = view.model.effects.map(e => e.kind).filter(k => known.has(k)), added = kinds.filter(k => !view.model.own.includes(k));
  await ask("run", {what: "fit", kinds: added.length ? added : kinds}); await beat(); });
go("stop", () => ask("stop", {}));
go("example", async () => { await ask("example", {}); await beat(); });
go("report", () => { window.open(`/report?token=${encodeURIComponent(token)}`, "_blank", "noopener"); });
const download = name => el("a", {href: `/saved/${encodeURIComponent(name)}?token=${encodeURIComponent(token)}`, download: name}, `Download ${name}`);
go("save", async () => { const s = await ask("save", {});
  dialog("The study is saved", `${s.path}\n\nBy commands, on all runs of the files:\n${s.commands.join("\n")}\n\n${s.yaml}`, [download(s.name)]); });
$("keep").addEventListener("change", attempt(async event => { const what = event.target.value; event.target.value = ""; if (!what) return;
  let s; $("keep").disabled = true; opening(what === "page" ? "Saving the whole page; its pictures are drawn, which takes some seconds." : "Saving …");
  try { s = await ask("keep", {what}); } finally { $("keep").disabled = false; opening(""); }
  dialog(`The study is saved, and ${what === "page" ? "the page" : what === "notebook" ? "the notebook" : "the commands"} beside it`, `${s.path}\n${s.kept_path}\n\n${what === "commands" ? s.text : what === "page" ? "It holds what is looked at now, and needs no server and no network." : "It opens this study and does the same steps, on all runs of the files."}`,
    [download(s.kept), " · ", download(s.name)]); }));
go("yaml", async () => { const s = await ask("yaml", {}); let told = "copied";
  try { await navigator.clipboard.writeText(s.yaml); } catch { told = "copy it from here"; } dialog(`As YAML, ${told}`, s.yaml, []); });
$("beside").addEventListener("change", attempt(async () => { $("beside").dataset.chosen = "1"; await besides(view.model, curvesOf); draw(); }));
for (const id of ["output", "over", "against", "seeaside"]) $(id).addEventListener("change", () => { share(); draw(); });
for (const [id, event] of [["space", "toggle"], ["spacerun", "change"]]) $(id).addEventListener(event, attempt(space));
$("files").addEventListener("change", attempt(async event => { await upload(event.target.files); event.target.value = ""; }));
document.addEventListener("dragover", event => { event.preventDefault(); document.body.classList.add("dragging"); });
document.addEventListener("dragleave", () => document.body.classList.remove("dragging"));
document.addEventListener("drop", attempt(async event => { event.preventDefault(); document.body.classList.remove("dragging"); await upload(event.dataTransfer.files); }));
document.addEventListener("keydown", event => { if ((event.ctrlKey || event.metaKey) && event.key === "z" && !/input|textarea/i.test(event.target.tagName)) { event.preventDefault(); $(event.shiftKey ? "redo" : "undo").click(); } });
// For tests and benchmarks: a model redrawn as a slider does, and how long it took until it stood on the screen.
window.pliantRedraw = async effects => { const t = performance.now(); await preview(effects, now.parts, false); draw("move");
  await new Promise(r => requestAnimationFrame(() => setTimeout(r, 0))); return performance.now() - t; };
pulse();
