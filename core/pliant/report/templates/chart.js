"use strict";
// Interactive charts of a report: each chart's data stands beside its still, and is drawn over uPlot when seen.
(() => {
  const {make, unpack} = PliantParts, INK = "#1d2433", SOFT = "#5c6577", GRID = "#eef0f4", NEAR = 24, FEW = 7, STEEP = 60, FONT = "system-ui, sans-serif";
  const LISTS = ["x", "y", "low", "high", "at", "values"], PLAIN = ["rule", "note"];
  const words = (value, axis) => axis.names.length ? axis.names[Math.round(value)] || ""
    : `${axis.label} ${Number(value.toPrecision(4))}${axis.unit ? ` ${axis.unit}` : ""}`;
  // Positions on an axis: linear, or logarithms of the values.
  const warp = (v, axis) => axis.log ? Math.log10(Math.max(v, 1e-300)) : v, unwarp = (v, axis) => axis.log ? 10 ** v : v;
  const padded = (low, high, share, axis) => { const a = warp(low, axis), b = warp(high, axis), pad = share * (b - a) || 0.5 * Math.abs(b) || 1;
    return [unwarp(a - pad, axis), unwarp(b + pad, axis)]; };
  const colour = (value, scale) => { const w = v => scale.log ? Math.log(Math.max(v, 1e-300)) : v, at = scale.at; let k = 1;
    while (k < at.length - 1 && value > at[k]) k++;
    const share = Math.min(1, Math.max(0, (w(value) - w(at[k - 1])) / (w(at[k]) - w(at[k - 1]) || 1)));
    return `rgb(${[1, 3, 5].map(i => { const [a, b] = [scale.colours[k - 1], scale.colours[k]].map(c => parseInt(c.slice(i, i + 2), 16));
      return Math.round(a + share * (b - a)); }).join(" ")})`; };
  // Ticks of a logarithmic axis: decades, and 2 and 5 between them if there are few (uPlot's own do not end below 1e-16).
  const decades = ([low, high]) => { const at = [], steps = high < 8 * low ? [1, 2, 3, 4, 5, 6, 7, 8, 9] : high < 500 * low ? [1, 2, 5] : [1];
    for (let k = Math.floor(Math.log10(low)); k <= Math.log10(high); k++) for (const step of steps) at.push(step * 10 ** k);
    return at.filter(v => v >= low && v <= high); };
  const isDark = rgb => { const [r, g, b] = rgb.match(/\d+/g).map(Number); return 0.3 * r + 0.59 * g + 0.11 * b < 128; };
  const SHAPES = {
    o: (c, x, y, r) => c.arc(x, y, r, 0, 7), s: (c, x, y, r) => c.rect(x - r, y - r, 2 * r, 2 * r),
    D: (c, x, y, r) => { c.moveTo(x, y - r); c.lineTo(x + r, y); c.lineTo(x, y + r); c.lineTo(x - r, y); c.closePath(); },
    "^": (c, x, y, r) => { c.moveTo(x, y - r); c.lineTo(x + r, y + r); c.lineTo(x - r, y + r); c.closePath(); },
    v: (c, x, y, r) => { c.moveTo(x, y + r); c.lineTo(x + r, y - r); c.lineTo(x - r, y - r); c.closePath(); },
    P: (c, x, y, r) => { c.rect(x - r, y - r / 2.5, 2 * r, r / 1.25); c.rect(x - r / 2.5, y - r, r / 1.25, 2 * r); },
    "*": (c, x, y, r) => { for (let k = 0; k < 10; k++) { const a = Math.PI * k / 5 - Math.PI / 2, q = k % 2 ? 0.45 * r : r;
      c.lineTo(x + q * Math.cos(a), y + q * Math.sin(a)); } c.closePath(); }};
  const STROKES = {
    x: (c, x, y, r) => { c.moveTo(x - r, y - r); c.lineTo(x + r, y + r); c.moveTo(x - r, y + r); c.lineTo(x + r, y - r); },
    "+": (c, x, y, r) => { c.moveTo(x - r, y); c.lineTo(x + r, y); c.moveTo(x, y - r); c.lineTo(x, y + r); },
    "|": (c, x, y, r) => { c.moveTo(x, y - r); c.lineTo(x, y + r); }};

  // One drawing function for each kind of mark. `at` has the positions X, Y, the shares of the height H, and r, device pixels per point.
  const DRAW = {
    line(c, m, at, panel) {
      const Y = m.rim ? at.H : at.Y, first = panel.marks.find(one => one.kind === "band");
      if (m.outside && first) fillOutside(c, m, first, at);
      c.strokeStyle = c.fillStyle = m.colour; c.lineWidth = (m.width || 0) * at.r; c.lineJoin = "round"; c.setLineDash(m.dashed ? [5 * at.r, 3 * at.r] : []);
      c.beginPath(); let pen = false;
      for (let k = 0; k < m.x.length; k++) { const x = m.x[k], y = m.y[k];
        if (x !== x || y !== y) { pen = false; continue; }
        if (pen) c.lineTo(at.X(x), Y(y)); else c.moveTo(at.X(x), Y(y)); pen = true; }
      if (m.fill) { c.fillStyle = m.fill; c.fill(); }
      if (m.width) c.stroke();
      c.setLineDash([]); if (!m.dot) return;
      const shape = SHAPES[m.marker], radius = m.dot / 2 * at.r; c.lineWidth = 1.2 * at.r;
      for (let k = 0; k < m.x.length; k++) { const x = m.x[k], y = m.y[k]; if (x !== x || y !== y) continue;
        c.beginPath(); (shape || STROKES[m.marker])(c, at.X(x), Y(y), radius);
        if (!shape) { c.stroke(); continue; }
        c.fillStyle = m.hollow ? "#fff" : m.values ? colour(m.values[k], panel.data.scale) : m.colour; c.fill();
        if (m.values) { c.strokeStyle = INK; c.lineWidth = 0.5 * at.r; }
        if (m.hollow || m.values) c.stroke(); }
    },
    band(c, m, at) {
      const Y = m.rim ? at.H : at.Y; c.fillStyle = m.colour; c.beginPath();
      for (let k = 0; k < m.x.length; k++) if (m.low[k] === m.low[k]) c.lineTo(at.X(m.x[k]), Y(m.low[k]));
      for (let k = m.x.length - 1; k >= 0; k--) if (m.high[k] === m.high[k]) c.lineTo(at.X(m.x[k]), Y(m.high[k]));
      c.fill();
    },
    bars(c, m, at) {
      c.fillStyle = m.colour;
      for (let k = 0; k < m.at.length; k++) { const h = m.thick / 2;
        const [x0, x1, y0, y1] = m.upright ? [at.X(m.at[k] - h), at.X(m.at[k] + h), at.Y(m.low[k]), at.Y(m.high[k])]
          : [at.X(m.low[k]), at.X(m.high[k]), at.Y(m.at[k] - h), at.Y(m.at[k] + h)];
        c.fillRect(x0, y0, x1 - x0, y1 - y0); }
    },
    cells(c, m, at, panel) {
      const columns = m.x.length - 1; c.textAlign = "center"; c.textBaseline = "middle"; c.font = `${8 * at.r}px ${FONT}`;
      for (let k = 0; k < m.values.length; k++) { const v = m.values[k], i = k % columns, j = Math.floor(k / columns); if (v !== v) continue;
        const [x0, x1, y0, y1] = [at.X(m.x[i]), at.X(m.x[i + 1]), at.Y(m.y[j]), at.Y(m.y[j + 1])], shade = colour(v, panel.data.scale);
        c.fillStyle = shade; c.fillRect(Math.min(x0, x1) - 0.3, Math.min(y0, y1) - 0.3, Math.abs(x1 - x0) + 0.6, Math.abs(y1 - y0) + 0.6);
        if (m.digits) { c.fillStyle = isDark(shade) ? "#fff" : INK; c.fillText(Number(v.toPrecision(m.digits)), (x0 + x1) / 2, (y0 + y1) / 2); } }
    },
    rule(c, m, at) {
      const b = at.box; c.strokeStyle = c.fillStyle = m.colour; c.lineWidth = m.width * at.r; c.setLineDash(m.dashed ? [5 * at.r, 3 * at.r] : []);
      c.beginPath(); if (m.upright) { c.moveTo(at.X(m.at || 0), b.top); c.lineTo(at.X(m.at || 0), b.top + b.height); }
      else { c.moveTo(b.left, at.Y(m.at || 0)); c.lineTo(b.left + b.width, at.Y(m.at || 0)); }
      c.stroke(); c.setLineDash([]); if (!m.text) return;
      c.font = `${8 * at.r}px ${FONT}`; c.textAlign = m.upright ? "left" : "right"; c.textBaseline = m.upright ? "top" : "bottom";
      if (m.upright) c.fillText(m.text, at.X(m.at || 0) + 3 * at.r, b.top + 2 * at.r); else c.fillText(m.text, b.left + b.width - 3 * at.r, at.Y(m.at || 0) - 2 * at.r);
    },
    note(c, m, at) {
      const [across, up] = {right: [1, 0], left: [-1, 0], above: [0, -1], below: [0, 1], centre: [0, 0]}[m.side];
      c.font = `${m.bold ? "bold " : ""}${8 * at.r}px ${FONT}`; c.fillStyle = m.colour;
      c.textAlign = ["right", "center", "left"][across + 1]; c.textBaseline = ["bottom", "middle", "top"][up + 1];
      const lines = m.text.split("\n"), y = (m.rim ? at.H : at.Y)(m.y || 0) + 5 * up * at.r;
      lines.forEach((text, k) => c.fillText(text, at.X(m.x || 0) + 5 * across * at.r, y + 10 * at.r * (up < 0 ? k - lines.length + 1 : k)));
    }};

  function fillOutside(c, line, band, at) {
    const out = k => line.y[k] < band.low[k] || line.y[k] > band.high[k];
    c.fillStyle = `${line.outside}bf`;
    for (let k = 1; k < line.x.length; k++) { if (!out(k - 1) || !out(k)) continue;
      c.beginPath(); c.moveTo(at.X(line.x[k - 1]), at.Y(0)); c.lineTo(at.X(line.x[k - 1]), at.Y(line.y[k - 1]));
      c.lineTo(at.X(line.x[k]), at.Y(line.y[k])); c.lineTo(at.X(line.x[k]), at.Y(0)); c.fill(); }
  }

  // The places of a mark that the pointer reads: x, y and the value that colours them.
  function places(m) {
    if (m.kind === "line" && !m.rim) return m.x.length ? [...m.x.keys()].map(k => [m.x[k], m.y[k], m.values && m.values[k]]) : [];
    if (m.kind === "bars") return [...m.at.keys()].map(k => m.upright ? [m.at[k], m.high[k]] : [m.high[k], m.at[k]]);
    if (m.kind !== "cells") return [];
    const n = m.x.length - 1;
    return [...m.values.keys()].map(k => { const i = k % n, j = Math.floor(k / n);
      return [(m.x[i] + m.x[i + 1]) / 2, (m.y[j] + m.y[j + 1]) / 2, m.values[k]]; });
  }

  class Panel {
    constructor(data, lists, off, follow) {
      this.data = data; this.off = off; this.follow = follow; this.marks = data.marks;
      for (const mark of this.marks) if (!PLAIN.includes(mark.kind)) for (const key of LISTS) if (key in mark) mark[key] = lists[mark[key]];
      this.box = make("div", {class: "panel", tabindex: "0", role: "img",
        "aria-label": `${data.title || data.y.label}: ${data.y.text} over ${data.x.text}. Plus and minus zoom, arrows move, 0 shows all.`});
      if (data.title) this.box.append(make("div", {class: "head"}, data.title), make("div", {class: "below"}, data.below));
      this.hold = make("div", {class: "hold"}); this.tip = make("div", {class: "tip", role: "status"}); this.tip.hidden = true;
      this.box.append(this.hold);
    }
    get down() { return this.data.y.names.length > 0; }
    // Names instead of numbers on an axis; nothing on an axis without a name.
    axis(which) {
      const data = this.data[which], names = data.names;
      const plain = {label: data.text, labelSize: 20, labelGap: 0, labelFont: `12px ${FONT}`, font: `12px ${FONT}`, stroke: SOFT,
        grid: {stroke: GRID, width: 1}, ticks: {stroke: "#dfe3ea", size: 4}};
      if (data.log) return {...plain, splits: () => decades(this.view[which]), filter: (u, at) => at, values: (u, at) => at.map(v => String(Number(v.toPrecision(1))))};
      if (!names.length) return data.label ? plain : {...plain, label: undefined, values: () => [], grid: {show: false}, ticks: {show: false}};
      const inside = () => names.map((_, k) => k).filter(v => v >= this.view[which][0] && v <= this.view[which][1]);
      const longest = Math.max(...names.map(name => name.length)), steep = which === "x" && names.length * longest > STEEP;
      return {...plain, ...(steep ? {rotate: 40, size: 20 + 4.5 * Math.min(longest, 30)} : {}), label: which === "x" ? data.text : undefined, splits: inside, values: (u, at) => at.map(v => names[v]), grid: {show: false}};
    }
    shown(mark) { return !this.off.has(`run ${mark.run || ""}`) && !this.off.has(`name ${mark.name || ""}`); }
    get alive() { return this.marks.some(mark => !PLAIN.includes(mark.kind) && this.shown(mark)); }
    all() {
      const ends = {x: [Infinity, -Infinity], y: [Infinity, -Infinity]};
      const take = (which, values) => { const log = this.data[which].log; for (const v of values) if (v === v && (!log || v > 0)) {
        ends[which][0] = Math.min(ends[which][0], v); ends[which][1] = Math.max(ends[which][1], v); } };
      for (const m of this.marks) { if (!this.shown(m) || PLAIN.includes(m.kind) || m.kind === "band" && m.rim) continue;
        if (m.kind === "bars") { const [a, b] = m.upright ? ["x", "y"] : ["y", "x"]; for (const d of [-m.thick, m.thick]) take(a, m.at.map(v => v + d / 2)); take(b, m.low); take(b, m.high); }
        else { if (m.kind !== "band") take("x", m.x); if (m.y && !m.rim) take("y", m.y); } }
      for (const which of ["x", "y"]) { const axis = this.data[which], cells = this.marks.some(m => m.kind === "cells");
        if (!(ends[which][1] >= ends[which][0])) ends[which] = [0, 1];
        ends[which] = axis.ends || (axis.names.length ? [-0.6, axis.names.length - 0.4] : cells ? ends[which] : padded(...ends[which], which === "x" ? 0.03 : 0.06, axis)); }
      return ends;
    }
    build(height) {
      this.view = this.all(); this.height = height; const {x, y} = this.data;
      const scale = (which, axis) => ({time: false, auto: false, range: () => this.view[which], distr: axis.log ? 3 : 1});
      this.plot = new uPlot({mode: 2, width: this.hold.clientWidth || 300, height, legend: {show: false}, padding: [6, 8, 0, 0],
        cursor: {drag: {x: true, y: true, uni: 20, setScale: false}, points: {show: false}, bind: {dblclick: () => () => null}},
        scales: {x: scale("x", x), y: {...scale("y", y), dir: this.down ? -1 : 1}},
        axes: [{size: 30, ...this.axis("x")}, {...this.axis("y"), space: 17,
          size: (u, texts) => texts ? Math.min(14 + 6.6 * Math.max(4, ...texts.map(text => String(text ?? "").length)), 0.45 * u.width) : 48}],
        series: [null, {paths: () => null, points: {show: false}}],
        hooks: {draw: [u => this.draw(u)], setSelect: [u => this.dragged(u)], setCursor: [u => this.point(u)]}},
        [null, [[0, 1], [0, 1]]], this.hold);
      this.hold.append(this.tip);
      this.plot.over.addEventListener("dblclick", () => this.look(null));
      this.plot.over.addEventListener("mouseleave", () => { this.tip.hidden = true; });
      this.box.addEventListener("keydown", event => { if (this.key(event.key)) event.preventDefault(); });
      new ResizeObserver(() => { const width = this.hold.clientWidth; if (width) { this.plot.setSize({width, height: this.height}); if (this.data.equal) { this.view = this.even(this.view); this.rescale(); } } }).observe(this.hold);
      this.view = this.even(this.view); this.rescale();
    }
    // Views of bodies: as long across as upward, by more room where there is too much of it.
    even({x, y}) {
      if (!this.data.equal || !this.plot) return {x, y};
      const w = this.plot.over.clientWidth || 300, h = this.plot.over.clientHeight || 200, per = Math.max((x[1] - x[0]) / w, (y[1] - y[0]) / h);
      const about = ([a, b], size) => { const c = (a + b) / 2; return [c - per * size / 2, c + per * size / 2]; };
      return {x: about(x, w), y: about(y, h)};
    }
    look(view) { this.view = this.even(view || this.all()); this.rescale(); this.follow(this, view === null); }
    rescale() {
      this.box.dataset.view = [...this.view.x, ...this.view.y].map(v => v.toPrecision(6)).join(" ");
      this.plot.batch(() => { for (const k of ["x", "y"]) this.plot.setScale(k, {min: this.view[k][0], max: this.view[k][1]}); });
      this.plot.redraw(false, true);
    }
    // The view with both ends of each axis changed by a function of their positions.
    changed(change) { const view = {}; for (const k of ["x", "y"]) { const axis = this.data[k];
      view[k] = change(this.view[k].map(v => warp(v, axis)), k).map(v => unwarp(v, axis)); } this.look(view); }
    zoom(f) { this.changed(([a, b]) => { const c = (a + b) / 2; return [c + f * (a - c), c + f * (b - c)]; }); }
    move(dx, dy) { this.changed(([a, b], k) => { const s = (k === "x" ? dx : this.down ? -dy : dy) * (b - a); return [a + s, b + s]; }); }
    key(name) {
      const does = {"+": () => this.zoom(0.8), "=": () => this.zoom(0.8), "-": () => this.zoom(1.25), "0": () => this.look(null),
        ArrowLeft: () => this.move(-0.1, 0), ArrowRight: () => this.move(0.1, 0), ArrowUp: () => this.move(0, 0.1), ArrowDown: () => this.move(0, -0.1)}[name];
      if (does) does(); return Boolean(does);
    }
    dragged(u) {
      const q = u.select; if (q.width < 3 && q.height < 3) return;
      const wide = q.width >= u.over.clientWidth - 2, tall = q.height >= u.over.clientHeight - 2, inOrder = (a, b) => [Math.min(a, b), Math.max(a, b)];
      const x = wide ? this.view.x : inOrder(u.posToVal(q.left, "x"), u.posToVal(q.left + q.width, "x"));
      const y = tall ? this.view.y : inOrder(u.posToVal(q.top + q.height, "y"), u.posToVal(q.top, "y"));
      u.setSelect({left: 0, top: 0, width: 0, height: 0}, false); this.look({x, y});
    }
    // The position of a value as a share of the axis, from its lower end.
    share(v, which) { const axis = this.data[which], [a, b] = this.view[which].map(end => warp(end, axis)), share = (warp(v, axis) - a) / (b - a);
      return which === "y" && this.down ? 1 - share : share; }
    draw(u) {
      const c = u.ctx, b = u.bbox, H = share => b.top + b.height * (1 - share);
      const at = {X: v => b.left + this.share(v, "x") * b.width, Y: v => H(this.share(v, "y")), H, box: b, r: 1.3 * (devicePixelRatio || 1)};
      c.save(); c.beginPath(); c.rect(b.left, b.top, b.width, b.height); c.clip();
      for (const mark of this.marks) if (mark.kind !== "note" && this.shown(mark)) DRAW[mark.kind](c, mark, at, this);
      c.restore(); c.save();
      for (const mark of this.marks) if (mark.kind === "note" && this.shown(mark) && this.inside(mark)) DRAW.note(c, mark, at);
      c.restore();
    }
    inside(note) { const x = this.share(note.x || 0, "x"), y = note.rim ? 0.5 : this.share(note.y || 0, "y"); return x > -0.01 && x < 1.2 && y > -0.01 && y < 1.05; }
    point(u) {
      const {left, top} = u.cursor; this.tip.hidden = true;
      if (left === undefined || left < 0 || top < 0) return;
      const w = u.over.clientWidth, h = u.over.clientHeight; let best = null, near = NEAR * NEAR;
      for (const mark of this.marks) { if (!this.shown(mark)) continue;
        mark.read = mark.read || places(mark);
        for (const place of mark.read) { const dx = this.share(place[0], "x") * w - left, dy = h * (1 - this.share(place[1], "y")) - top, d = dx * dx + dy * dy;
          if (d < near) { near = d; best = [mark, place]; } } }
      if (!best) return;
      const [mark, [x, y, value]] = best, {scale} = this.data;
      const also = value === value && value !== undefined && scale ? `\n${words(value, {...scale, names: []})}` : "";
      this.tip.textContent = `${[mark.run, mark.name].filter(Boolean).join(": ")}\n${words(y, this.data.y)}\n${words(x, this.data.x)}${also}`;
      this.tip.hidden = false;
      const right = left > w / 2;
      this.tip.style.left = right ? "" : `${u.over.offsetLeft + left + 12}px`;
      this.tip.style.right = right ? `${this.hold.clientWidth - u.over.offsetLeft - left + 12}px` : "";
      this.tip.style.top = `${u.over.offsetTop + top + 8}px`;
    }
  }

  // The scale of the colours, under its panels.
  function colourBar(scale) {
    const shown = make("div", {class: "colours"}), bar = make("i"), end = v => make("b", {}, Number(v.toPrecision(3)));
    const at = scale.at.map(v => scale.log ? Math.log(v) : v), part = k => 100 * (at[k] - at[0]) / (at[at.length - 1] - at[0]);
    bar.style.background = `linear-gradient(to right, ${scale.colours.map((c, k) => `${c} ${part(k)}%`).join(", ")})`;
    shown.append(end(scale.at[0]), bar, end(scale.at[scale.at.length - 1]), make("span", {}, `${scale.label}${scale.unit ? ` (${scale.unit})` : ""}`));
    return shown;
  }

  function chart(figure) {
    const data = PliantParts.data(figure);
    const lists = data.lists.map(unpack), off = new Set(), live = make("div", {class: "chart"}), grid = make("div", {class: "panels"});
    const follow = (from, all) => { if (from.data.linked) for (const other of panels)
      if (other !== from && other.data.linked === from.data.linked) { other.view = all ? other.all() : {x: from.view.x, y: other.view.y}; other.rescale(); } };
    const panels = data.panels.map(one => new Panel(one, lists, off, follow));
    const refresh = () => { for (const p of panels) p.box.hidden = !p.alive;
      for (const cell of grid.children) cell.hidden = [...cell.children].every(box => box.hidden);
      for (const p of panels) if (p.plot && !p.box.hidden) p.plot.redraw(false, true); };
    const switches = (kind, title, parts) => {
      if (parts.size < 2) return null;
      const group = make("details", {class: "switches"}); group.open = kind === "name" && parts.size <= FEW; group.append(make("summary", {}, `${title} (${parts.size})`));
      const boxes = [...parts].map(([name, colour]) => {
        const label = make("label"), box = make("input", {type: "checkbox"}); box.checked = true;
        box.addEventListener("change", () => { box.checked ? off.delete(`${kind} ${name}`) : off.add(`${kind} ${name}`); refresh(); });
        label.append(box); if (kind === "name") { const swatch = make("i"); swatch.style.background = colour; label.append(swatch); }
        label.append(document.createTextNode(name)); group.append(label); return box; });
      const every = make("button", {type: "button"}, "all or none");
      every.addEventListener("click", () => { const to = !boxes.every(box => box.checked);
        for (const box of boxes) if (box.checked !== to) box.click(); });
      group.append(every); return group; };
    const runs = new Map(), names = new Map();
    for (const {kind, run, name, colour} of panels.flatMap(p => p.marks)) { if (run) runs.set(run, ""); if (name && kind !== "cells" && !names.has(name)) names.set(name, colour); }
    const bar = make("div", {class: "bar", role: "group", "aria-label": "picture"});
    const button = (text, does) => { const b = make("button", {type: "button"}, text); b.addEventListener("click", does); bar.append(b); return b; };
    button("zoom in", () => panels.forEach(p => p.zoom(0.8)));
    button("zoom out", () => panels.forEach(p => p.zoom(1.25)));
    button("show all", () => panels.forEach(p => p.look(null)));
    const still = button("still picture", () => { const to = figure.classList.toggle("live"); grid.hidden = !to;
      still.setAttribute("aria-pressed", String(!to)); });
    still.setAttribute("aria-pressed", "false");
    for (const group of [switches("run", "Runs", runs), switches("name", "Lines", names)]) if (group) bar.append(group);
    const step = data.column;
    for (let k = 0; k < panels.length; k += step) { const cell = make("div", {class: "cell"});
      for (const p of panels.slice(k, k + step)) cell.append(p.box); grid.append(cell); }
    live.append(bar, grid);
    const scales = new Map(panels.filter(p => p.data.scale).map(p => [JSON.stringify(p.data.scale), p]));
    for (const [, p] of scales) (scales.size > 1 ? p.box : live).append(colourBar(p.data.scale));
    figure.querySelector("img").after(live); figure.classList.add("live");
    const few = panels.length <= 3 * step;
    if (few) grid.classList.add("few");
    const tall = few ? 340 : 230, heights = data.heights.length ? data.heights : Array(step).fill(1);
    panels.forEach((p, k) => p.build(Math.max(Math.round(tall * heights[k % step] / Math.max(...heights)), 24 * p.data.y.names.length + 50, few ? 150 : 110)));
  }

  PliantParts.whenSeen("figure[data-chart]", chart);
})();
