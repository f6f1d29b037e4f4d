"use strict";
// The list of effects: tick boxes, what each could explain, sliders, look-alikes.
const short = v => Number.isFinite(v) ? String(+v.toPrecision(4)) : "–";
const percent = v => !(v > 0) ? "0 %" : v < 0.001 ? "< 0.1 %" : v < 0.1 ? `${(100 * v).toFixed(1)} %` : `${Math.round(100 * v)} %`;
const chance = p => p > 0.99 ? "over 99 %" : p < 0.01 ? "below 1 %" : `${Math.round(100 * p)} %`;

function el(tag, at = {}, ...inside) {
  const e = document.createElement(tag);
  for (const [k, v] of Object.entries(at)) {
    if (k === "class") e.className = v; else if (k.startsWith("on")) e.addEventListener(k.slice(2), v);
    else if (v === true) e.setAttribute(k, ""); else if (v !== false && v !== null) e.setAttribute(k, v);
  }
  e.append(...inside.filter(one => one !== null && one !== undefined && one !== ""));
  return e;
}

const FIRST = 9;  // effects that are not folded away
class EffectList {
  // moved(effects): while a slider moves; settled(effects, words): when the model shall be that; ticked(kind, on).
  constructor(hold, moved, settled, ticked) { this.hold = hold; this.moved = moved; this.settled = settled; this.ticked = ticked; this.rows = new Map(); this.busy = false; }

  show(model, screen, stale = false) {
    if (this.busy) return;
    this.hold.classList.toggle("stale", stale);
    this.model = model; this.effects = model.effects.map(one => ({...one}));
    const kinds = screen ? screen.kinds : {}, found = model.diagnosis;
    const of = kind => kinds[kind] ? kinds[kind].explains : -1;
    const ticked = new Set(this.effects.map(one => one.kind));
    const sure = kind => found && found.by_kind[kind] || 0;
    const unlisted = model.effects.filter(e => !model.catalogue.some(c => c.kind === e.kind))
      .map(e => ({kind: e.kind, summary: "describes what no listed effect explains", signature: "", sliders: [], begun: e}));
    const order = [...unlisted, ...model.catalogue].filter(one => !screen || kinds[one.kind] || ticked.has(one.kind))
      .sort((a, b) => ticked.has(b.kind) - ticked.has(a.kind) || sure(b.kind) - sure(a.kind) || of(b.kind) - of(a.kind));
    const focus = document.activeElement && document.activeElement.id;
    const seen = order.filter(one => ticked.has(one.kind) || !screen || kinds[one.kind].shown);
    const first = seen.filter((one, k) => k < FIRST || ticked.has(one.kind)), more = seen.filter(one => !first.includes(one));
    const open = this.hold.querySelector("details.more") && this.hold.querySelector("details.more").open;
    const rows = list => list.map(one => this.row(one, kinds[one.kind], ticked));
    this.hold.replaceChildren(...rows(first), ...(more.length ? [el("details", {class: "more", open}, el("summary", {}, `${more.length} more`), ...rows(more))] : []));
    if (focus && document.getElementById(focus)) document.getElementById(focus).focus({preventScroll: true});
  }
  row(one, seen, ticked) {
    const id = `effect-${one.kind}`, has = ticked.has(one.kind), found = this.model.diagnosis;
    const box = el("input", {type: "checkbox", id, onchange: event => this.ticked(one.kind, event.target.checked)});
    box.checked = has;
    const badge = found && found.by_kind[one.kind] !== undefined
      ? el("span", {class: `badge${found.by_kind[one.kind] > 0.5 ? " sure" : ""}`, title: "probability that it is among what is missing, by the diagnosis"}, `${chance(found.by_kind[one.kind])} probable`) : null;
    const own = this.model.own.includes(one.kind) ? el("span", {class: "badge"}, "of the study") : null;
    const mine = one.file ? el("span", {class: "badge", title: "your own effect; it is read anew when the file changes"}, `from ${one.file}`) : null;
    const bar = el("div", {class: "bar", "aria-hidden": "true"}, el("i", {style: `width:${seen ? 100 * seen.explains : 0}%`}));
    const head = el("div", {class: "head"}, box, el("label", {for: id}, one.kind.replaceAll("_", " "), " ", badge, " ", own, " ", mine), bar,
      el("span", {class: "percent", title: "of the error that is left, at most"}, seen ? `≤ ${percent(seen.explains)}` : "…"));
    const alike = seen ? seen.alike.filter(k => k !== one.kind) : [];
    const rows = [head, el("p", {class: "words soft"}, one.summary)];
    if (has) {
      for (const slider of one.sliders) rows.push(this.slider(one, slider));
      if (one.signature) rows.push(el("p", {class: "words soft"}, `Known by this: ${one.signature}`));
    }
    if (alike.length && (has || seen.explains > 0.02)) rows.push(el("p", {class: "tie"}, this.tie(one.kind, alike)));
    return el("div", {class: "effect"}, ...rows);
  }
  tie(kind, alike) {
    const names = alike.slice(0, 4).join(", ").replaceAll("_", " ") + (alike.length > 4 ? ` and ${alike.length - 4} more` : "");
    return `These runs do not distinguish it from ${names}.`;
  }
  slider(one, s) {
    const now = this.effects.find(e => e.kind === one.kind), id = `slider-${one.kind}-${s.name}`;
    const to = v => s.log ? Math.log(Math.max(v, s.low)) : v, back = x => s.log ? Math.exp(x) : x;
    const range = el("input", {type: "range", id, min: to(s.low), max: to(s.high), step: (to(s.high) - to(s.low)) / 400,
      "aria-label": `${one.kind} ${s.name}`});
    const number = el("input", {type: "number", step: "any", "aria-label": `${one.kind} ${s.name} in ${s.unit || "1"}`});
    const put = v => { range.value = to(v); number.value = short(v * s.factor); };
    put(now[s.name]);
    const set = v => { now[s.name] = v; };
    range.addEventListener("input", () => { this.busy = true; const v = back(+range.value); set(v); number.value = short(v * s.factor); this.moved(this.effects); });
    range.addEventListener("change", () => { this.busy = false; this.settled(this.effects, `${one.kind} ${s.words} ${number.value} ${s.unit}`.trim()); });
    number.addEventListener("change", () => { const v = +number.value / s.factor; if (!Number.isFinite(v)) return; set(v); put(v); this.settled(this.effects, `${one.kind} ${s.name} ${number.value} ${s.unit}`.trim()); });
    const fit = this.model.fit, told = fit ? fit.estimates.find(e => e.kind === one.kind && e.parameter === s.name) : null;
    return el("div", {class: "slider"}, el("label", {for: id}, s.words, s.unit ? ` (${s.unit})` : ""), range, number,
      told ? el("span", {class: "fitted"}, `fitted: ${told.words}`) : null);
  }
}
