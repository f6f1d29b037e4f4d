"use strict";
// One scatter picture over uPlot: measured points, lines of models, a marked region that all pictures share.
const INK = "#1d2433", MODEL = "#0072b2", PLAIN = "#a9628f", MARK = "#d55e00", BAND = "#e8eef5", FAINT = "#7f8897";

class Picture {
  // hold: the element; brush(test): told which points a dragged box holds; words(k): of point k for the pointer.
  constructor(hold, height, brush, words) {
    this.hold = hold; this.height = height; this.brush = brush; this.words = words;
    this.shown = null; this.view = null; this.plot = null; this.tip = document.createElement("div");
    this.tip.className = "tip"; this.tip.hidden = true;
    new ResizeObserver(() => this.plot && this.plot.setSize({width: this.width(), height: this.height})).observe(hold);
  }
  width() { return Math.max(this.hold.clientWidth, 200); }

  // shown: {of: what a zoom holds for, x, y: points, lines: [{values, colour, width}], runs: [start…], on, marked, faint, band, xlabel, ylabel, name}; moving: y
  // changes with the model.
  show(shown) {
    const fresh = !this.shown || this.shown.xlabel !== shown.xlabel || this.shown.ylabel !== shown.ylabel;
    if (fresh || this.shown.of !== shown.of) this.zoomed = false;
    this.shown = shown;
    if (fresh || !this.view) { this.view = null; this.make(); return; }
    if (!this.zoomed) this.view = this.extent();  // nothing that is shown lies outside, but where the reader zoomed in
    this.rescale();
  }
  extent() {
    const s = this.shown; let x0 = Infinity, x1 = -Infinity, y0 = Infinity, y1 = -Infinity;
    for (let k = 0; k < s.x.length; k++) {
      if (!s.on[k] || s.x[k] === null) continue;
      const take = v => { if (v !== null && v === v) { if (v < y0) y0 = v; if (v > y1) y1 = v; } };
      if (s.x[k] < x0) x0 = s.x[k]; if (s.x[k] > x1) x1 = s.x[k];
      take(s.y[k]); for (const line of s.lines) take(line.values[k]);
    }
    if (!(x1 >= x0)) { x0 = 0; x1 = 1; } if (!(y1 >= y0)) { y0 = 0; y1 = 1; }
    const px = s.categories && s.categories.length ? 0.5 : 0.02 * (x1 - x0 || 1), py = 0.06 * (y1 - y0 || 1);
    return {x: [x0 - px, x1 + px], y: [y0 - py, y1 + py]};
  }
  make() {
    if (this.plot) this.plot.destroy();
    this.view = this.extent();
    const s = this.shown, axis = label => ({label, labelSize: 22, labelFont: "12px system-ui", font: "12px system-ui",
      stroke: "#5c6577", grid: {stroke: "#eef0f4", width: 1}, ticks: {stroke: "#dfe3ea"}});
    const y = axis(s.ylabel); y.size = 54;
    const x = axis(s.xlabel); x.size = 34; x.labelGap = 0; x.gap = 3;
    if (s.categories && s.categories.length) {
      x.splits = () => s.categories.map((_, k) => k); x.values = () => s.categories; }
    this.plot = new uPlot({mode: 2, width: this.width(), height: this.height, legend: {show: false},
      padding: [8, 10, 0, 0],
      cursor: {drag: {x: true, y: true, uni: 12, setScale: false}, points: {show: false}, bind: {dblclick: () => () => null}},
      scales: {x: {time: false, auto: false, range: () => this.view.x}, y: {auto: false, range: () => this.view.y}},
      axes: [x, y], series: [null, {paths: () => null, points: {show: false}}],
      hooks: {draw: [u => this.draw(u)], setSelect: [u => this.selected(u)], setCursor: [u => this.point(u)]}},
      [null, [s.x, s.y]], this.hold);
    this.hold.appendChild(this.tip);
    [this.models, this.dots] = ["models", "dots"].map(name => { const sheet = document.createElement("canvas");
      sheet.className = `sheet ${name}`; this.plot.over.before(sheet); return sheet; });
    const over = this.plot.over;
    over.addEventListener("dblclick", () => { this.zoomed = false; this.view = this.extent(); this.rescale(); this.brush(null); });
    over.addEventListener("mouseleave", () => { this.tip.hidden = true; });
    over.addEventListener("wheel", event => {
      event.preventDefault(); this.zoomed = true;
      const box = over.getBoundingClientRect(), f = event.deltaY < 0 ? 0.8 : 1.25;
      const cx = this.plot.posToVal(event.clientX - box.left, "x"), cy = this.plot.posToVal(event.clientY - box.top, "y");
      this.view = {x: this.view.x.map(v => cx + f * (v - cx)), y: this.view.y.map(v => cy + f * (v - cy))};
      this.rescale();
    }, {passive: false});
    this.hold.setAttribute("role", "img"); this.hold.setAttribute("aria-label", s.name);
    this.rescale();
  }
  rescale() {
    this.plot.batch(() => {
      this.plot.setScale("x", {min: this.view.x[0], max: this.view.x[1]});
      this.plot.setScale("y", {min: this.view.y[0], max: this.view.y[1]});
    });
    this.plot.redraw(false, true);
  }
  // Only the model moved: the readings and the axes, on sheets above and beneath, stay as they are.
  move(shown) {
    if (!this.shown || !this.plot || this.shown.xlabel !== shown.xlabel || this.shown.ylabel !== shown.ylabel) { this.show(shown); return; }
    this.shown = shown; this.drawMoving(this.plot);
  }
  scaled(u) {
    const b = u.bbox, [x0, x1] = this.view.x, [y0, y1] = this.view.y, fx = b.width / (x1 - x0), fy = b.height / (y1 - y0);
    return {b, fx, X: v => b.left + (v - x0) * fx, Y: v => b.top + b.height - (v - y0) * fy};
  }
  draw(u) {
    const s = this.shown, c = u.ctx, r = devicePixelRatio || 1, {b, fx, X} = this.scaled(u);
    c.save(); c.beginPath(); c.rect(b.left, b.top, b.width, b.height); c.clip();
    if (s.rules) { c.font = `${11 * r}px system-ui`; c.textBaseline = "top";
      for (const rule of s.rules) { c.fillStyle = "#eef0f4"; c.fillRect(X(rule.at), b.top, r, b.height);
        c.fillStyle = "#5c6577"; if (rule.width * fx > 18 * r) c.fillText(rule.text, X(rule.at) + 3 * r, b.top + r); } }
    c.restore();
    const over = this.cleared(u, this.dots);
    if (!s.moving) this.points(u, over);
    over.restore();
    this.drawMoving(u);
  }
  // A sheet as large as the picture, empty, to be drawn on within the axes.
  cleared(u, sheet) {
    const {b} = this.scaled(u), c = sheet.getContext("2d"), {width, height} = u.ctx.canvas;
    if (sheet.width !== width || sheet.height !== height) { sheet.width = width; sheet.height = height; }
    c.clearRect(0, 0, width, height);
    c.save(); c.beginPath(); c.rect(b.left, b.top, b.width, b.height); c.clip();
    return c;
  }
  // The sheet of the models: the band, their lines, and readings that move with them.
  drawMoving(u) {
    const s = this.shown, r = devicePixelRatio || 1, {b, X, Y} = this.scaled(u), c = this.cleared(u, this.models);
    if (s.band) { c.fillStyle = BAND; c.fillRect(b.left, Y(s.band), b.width, Y(-s.band) - Y(s.band));
      c.fillStyle = FAINT; c.fillRect(b.left, Y(0) - r / 2, b.width, r); }
    for (const line of s.lines) {
      c.strokeStyle = line.colour; c.lineWidth = (line.width || 1.6) * r; c.lineJoin = "round"; c.beginPath();
      let pen = false, next = 0;
      for (let k = 0; k < s.x.length; k++) {
        if (k === s.starts[next]) { pen = false; next++; }
        const v = line.values[k], at = s.x[k];
        if (!s.on[k] || v === null || v !== v || at === null) { pen = false; continue; }
        if (pen) c.lineTo(X(at), Y(v)); else { c.moveTo(X(at), Y(v)); pen = true; }
      }
      c.stroke();
    }
    if (s.moving) this.points(u, c);
    c.restore();
  }
  points(u, c) {
    const s = this.shown, r = devicePixelRatio || 1, {X, Y} = this.scaled(u), size = (s.x.length > 4000 ? 1.6 : 2.4) * r;
    const looks = [[FAINT, size], [INK, size], [MARK, 1.5 * size]];  // a colour is set once, for all of its points
    for (const [pass, [colour, d]] of looks.entries()) {
      c.fillStyle = colour;
      for (let k = 0; k < s.x.length; k++) {
        if (!s.on[k] || s.x[k] === null || s.y[k] === null || s.y[k] !== s.y[k]) continue;
        if ((s.marked && s.marked[k] ? 2 : s.faint[k] ? 0 : 1) === pass) c.fillRect(X(s.x[k]) - d / 2, Y(s.y[k]) - d / 2, d, d);
      }
    }
  }
  selected(u) {
    const q = u.select;
    if (q.width < 3 && q.height < 3) { return; }
    const xs = [u.posToVal(q.left, "x"), u.posToVal(q.left + q.width, "x")];
    const whole = q.height >= u.over.clientHeight - 2, wide = q.width >= u.over.clientWidth - 2;
    const ys = [u.posToVal(q.top + q.height, "y"), u.posToVal(q.top, "y")];
    const s = this.shown;
    this.brush(k => s.x[k] !== null && s.y[k] !== null && (wide || (s.x[k] >= xs[0] && s.x[k] <= xs[1])) &&
      (whole || (s.y[k] >= ys[0] && s.y[k] <= ys[1])));
    u.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
  }
  point(u) {
    const {left, top} = u.cursor, s = this.shown;
    if (left === undefined || left < 0 || top < 0) { this.tip.hidden = true; return; }
    let best = -1, near = 16 * 16;
    const x = u.posToVal(left, "x"), y = u.posToVal(top, "y");
    const fx = u.over.clientWidth / (this.view.x[1] - this.view.x[0]), fy = u.over.clientHeight / (this.view.y[1] - this.view.y[0]);
    for (let k = 0; k < s.x.length; k++) {
      if (!s.on[k] || s.x[k] === null || s.y[k] === null) continue;
      const dx = (s.x[k] - x) * fx, dy = (s.y[k] - y) * fy, d = dx * dx + dy * dy;
      if (d < near) { near = d; best = k; }
    }
    this.tip.hidden = best < 0;
    if (best < 0) return;
    this.tip.textContent = this.words(best);
    const right = left > u.over.clientWidth / 2;
    this.tip.style.left = right ? "" : `${u.over.offsetLeft + left + 14}px`;
    this.tip.style.right = right ? `${this.hold.clientWidth - u.over.offsetLeft - left + 14}px` : "";
    this.tip.style.top = `${u.over.offsetTop + top + 8}px`;
  }
}

// The error after each step: hollow on fitted runs, filled on runs held out.
function stairs(svg, steps, cursor) {
  const ns = "http://www.w3.org/2000/svg", W = svg.clientWidth || 400, H = 190, left = 34, bottom = 24, top = 10;
  svg.setAttribute("viewBox", `0 0 ${W} ${H}`); svg.replaceChildren();
  const add = (tag, at, text) => { const e = document.createElementNS(ns, tag);
    for (const [k, v] of Object.entries(at)) e.setAttribute(k, v); if (text) e.textContent = text; svg.appendChild(e); return e; };
  const values = steps.flatMap(s => [s.error, s.aside]).filter(v => v !== null);
  const most = Math.max(1.2, ...values) * 1.08, n = steps.length;
  const X = k => left + (k + 0.5) * (W - left - 8) / n, Y = v => top + (1 - v / most) * (H - top - bottom), half = (W - left - 8) / n / 2;
  const tick = most > 8 ? Math.ceil(most / 5) : most > 3 ? 1 : 0.5;
  for (let v = 0; v <= most; v += tick) {
    add("line", {x1: left, x2: W - 8, y1: Y(v), y2: Y(v), stroke: "#eef0f4"});
    add("text", {x: left - 6, y: Y(v) + 4, "text-anchor": "end", "font-size": 11, fill: "#5c6577"}, String(+v.toFixed(1)));
  }
  add("line", {x1: left, x2: W - 8, y1: Y(1), y2: Y(1), stroke: MARK, "stroke-dasharray": "5 4"});
  add("text", {x: W - 10, y: Y(1) - 4, "text-anchor": "end", "font-size": 11, fill: "#b34f00"}, "noise floor");
  for (const [key, colour, fill, width] of [["error", "#5c6577", "#ffffff", 1.4], ["aside", MODEL, MODEL, 2.4]]) {
    let path = "";
    steps.forEach((s, k) => { if (s[key] === null || k > cursor) return;
      path += `${path ? "L" : "M"}${X(k) - half},${Y(s[key])}L${X(k) + half},${Y(s[key])}`; });
    if (path) add("path", {d: path, stroke: colour, "stroke-width": width, fill: "none"});
    steps.forEach((s, k) => { if (s[key] === null) return;
      add("circle", {cx: X(k), cy: Y(s[key]), r: 4.5, fill, stroke: colour, "stroke-width": 1.6, opacity: k > cursor ? 0.4 : 1})
        .appendChild(document.createElementNS(ns, "title")).textContent = `${s.words}: ${s[key].toFixed(2)} times the noise`; });
  }
  steps.forEach((s, k) => add("text", {x: X(k), y: H - 6, "text-anchor": "middle", "font-size": 11,
    fill: k === cursor ? INK : "#5c6577", "font-weight": k === cursor ? 700 : 400}, String(k + 1)));
  svg.setAttribute("aria-label", steps.slice(0, cursor + 1).map((s, k) =>
    `step ${k + 1}, ${s.words}: ${s.aside === null ? "no run held out" : s.aside.toFixed(2) + " on runs held out"}, ${s.error === null ? "–" : s.error.toFixed(2)} on fitted runs`).join("; "));
}
// The learned term over its circumstance: line, 90 % band, grey where there are no data.
function learnedCurve(svg, curve) {
  const ns = "http://www.w3.org/2000/svg", W = svg.clientWidth || 400, H = 200, left = 52, bottom = 40, top = 8, right = 8;
  svg.setAttribute("viewBox", `0 0 ${W} ${H}`); svg.replaceChildren();
  const add = (tag, at, text) => { const e = document.createElementNS(ns, tag);
    for (const [k, v] of Object.entries(at)) e.setAttribute(k, v); if (text) e.textContent = text; svg.appendChild(e); return e; };
  const {x, value, half, ends} = curve, n = x.length, high = Math.max(...value.map((v, k) => v + half[k]), 0), low = Math.min(...value.map((v, k) => v - half[k]), 0);
  const X = v => left + (v - x[0]) / (x[n - 1] - x[0]) * (W - left - right), Y = v => top + (high - v) / ((high - low) || 1) * (H - top - bottom);
  for (const [from, to] of [[x[0], ends[0]], [ends[1], x[n - 1]]]) add("rect", {x: X(from), y: top, width: Math.max(X(to) - X(from), 0), height: H - top - bottom, fill: "#e4e7ec"});
  const path = points => points.map(([a, b], k) => `${k ? "L" : "M"}${X(a).toFixed(1)},${Y(b).toFixed(1)}`).join("");
  const up = x.map((v, k) => [v, value[k] + half[k]]), down = x.map((v, k) => [v, value[k] - half[k]]).reverse();
  add("path", {d: `${path([...up, ...down])}Z`, fill: "#bcd9ee"});
  add("line", {x1: left, x2: W - right, y1: Y(0), y2: Y(0), stroke: "#5c6577"});
  add("path", {d: path(x.map((v, k) => [v, value[k]])), fill: "none", stroke: MODEL, "stroke-width": 2.2});
  curve.knots[0].forEach((v, k) => add("circle", {cx: X(v), cy: Y(curve.knots[1][k]), r: 3, fill: MODEL}));
  const say = (at, text) => add("text", {"font-size": 11, fill: "#5c6577", ...at}, text);
  for (const v of [low, high]) say({x: left - 5, y: Y(v) + 4, "text-anchor": "end"}, String(+v.toPrecision(2)));
  for (const v of ends) say({x: X(v), y: H - bottom + 14, "text-anchor": "middle"}, String(+v.toPrecision(3)));
  say({x: (left + W) / 2, y: H - 6, "text-anchor": "middle"}, curve.over);
  say({x: 12, y: (top + H - bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${(top + H - bottom) / 2})`}, curve.what);
  svg.setAttribute("aria-label", `learned term: ${curve.what} over ${curve.over}, data from ${+ends[0].toPrecision(3)} to ${+ends[1].toPrecision(3)}`);
}
