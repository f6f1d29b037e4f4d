"use strict";
// Moving pictures of a report: each chart's data stands beside its still picture, and is drawn over uPlot when seen.
(() => {
  const {make, unpack} = PliantParts, SOFT = "#5c6577", GRID = "#eef0f4", NEAR = 24;
  const words = (value, axis) => `${axis.label} ${Number(value.toPrecision(4))}${axis.unit ? ` ${axis.unit}` : ""}`;
  const ends = (low, high, share) => { const pad = share * (high - low) || 0.5 * Math.abs(high) || 1; return [low - pad, high + pad]; };

  class Panel {
    constructor(data, lists, off, follow) {
      this.data = data; this.off = off; this.follow = follow;
      const of = part => { for (const key of ["x", "y", "low", "high"]) if (key in part) part[key] = lists[part[key]]; return part; };
      this.lines = data.lines.map(of); this.bands = data.bands.map(of);
      this.box = make("div", {class: "panel", tabindex: "0", role: "img",
        "aria-label": `${data.title || data.y.label}: ${data.y.text} over ${data.x.text}. Plus and minus zoom, arrows move, 0 shows all.`});
      if (data.title) this.box.append(make("div", {class: "head"}, data.title), make("div", {class: "below"}, data.below));
      this.hold = make("div", {class: "hold"}); this.tip = make("div", {class: "tip", role: "status"}); this.tip.hidden = true;
      this.box.append(this.hold);
    }
    // Names instead of numbers on the upright axis.
    named() { const names = this.data.y.names; if (!names.length) return {};
      const inside = () => names.map((_, k) => -k).filter(v => v >= this.view.y[0] && v <= this.view.y[1]).reverse();
      return {label: undefined, splits: inside, values: (u, at) => at.map(v => names[-v]), grid: {show: false}}; }
    shown(part) { return !this.off.has(`run ${part.run}`) && !this.off.has(`name ${part.name}`); }
    get alive() { return this.lines.some(line => this.shown(line)); }
    all() {
      let x0 = Infinity, x1 = -Infinity, y0 = Infinity, y1 = -Infinity;
      const take = (xs, ys) => { for (let k = 0; k < xs.length; k++) { if (xs[k] !== xs[k] || ys[k] !== ys[k]) continue;
        x0 = Math.min(x0, xs[k]); x1 = Math.max(x1, xs[k]); y0 = Math.min(y0, ys[k]); y1 = Math.max(y1, ys[k]); } };
      for (const line of this.lines) if (this.shown(line)) take(line.x, line.y);
      if (!(x1 >= x0)) { x0 = 0; x1 = 1; y0 = 0; y1 = 1; }
      return {x: ends(x0, x1, 0.02), y: this.data.range || ends(y0, y1, 0.06)};
    }
    build(height) {
      const axis = text => ({label: text, labelSize: 20, labelGap: 0, labelFont: "12px system-ui", font: "12px system-ui", stroke: SOFT,
        grid: {stroke: GRID, width: 1}, ticks: {stroke: "#dfe3ea", size: 4}});
      this.view = this.all(); this.height = height;
      this.plot = new uPlot({mode: 2, width: this.hold.clientWidth || 300, height, legend: {show: false}, padding: [6, 8, 0, 0],
        cursor: {drag: {x: true, y: true, uni: 20, setScale: false}, points: {show: false}, bind: {dblclick: () => () => null}},
        scales: {x: {time: false, auto: false, range: () => this.view.x}, y: {auto: false, range: () => this.view.y}},
        axes: [{...axis(this.data.x.text), size: 30}, {...axis(this.data.y.text), space: 17, ...this.named(),
          size: (u, texts) => texts ? 14 + 7 * Math.max(4, ...texts.map(text => String(text).length)) : 48}],
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
    zoom(f) { const about = ([a, b]) => { const c = (a + b) / 2; return [c + f * (a - c), c + f * (b - c)]; };
      this.look({x: about(this.view.x), y: about(this.view.y)}); }
    move(dx, dy) { const by = ([a, b], s) => [a + s * (b - a), b + s * (b - a)];
      this.look({x: by(this.view.x, dx), y: by(this.view.y, dy)}); }
    key(name) {
      const does = {"+": () => this.zoom(0.8), "=": () => this.zoom(0.8), "-": () => this.zoom(1.25), "0": () => this.look(null),
        ArrowLeft: () => this.move(-0.1, 0), ArrowRight: () => this.move(0.1, 0), ArrowUp: () => this.move(0, 0.1), ArrowDown: () => this.move(0, -0.1)}[name];
      if (does) does(); return Boolean(does);
    }
    dragged(u) {
      const q = u.select; if (q.width < 3 && q.height < 3) return;
      const wide = q.width >= u.over.clientWidth - 2, tall = q.height >= u.over.clientHeight - 2;
      const x = wide ? this.view.x : [u.posToVal(q.left, "x"), u.posToVal(q.left + q.width, "x")];
      const y = tall ? this.view.y : [u.posToVal(q.top + q.height, "y"), u.posToVal(q.top, "y")];
      u.setSelect({left: 0, top: 0, width: 0, height: 0}, false); this.look({x, y});
    }
    draw(u) {
      const c = u.ctx, r = devicePixelRatio || 1, b = u.bbox, [x0, x1] = this.view.x, [y0, y1] = this.view.y;
      const X = v => b.left + (v - x0) / (x1 - x0) * b.width, Y = v => b.top + b.height - (v - y0) / (y1 - y0) * b.height;
      c.save(); c.beginPath(); c.rect(b.left, b.top, b.width, b.height); c.clip();
      for (const band of this.bands) { if (!this.shown(band)) continue;
        c.fillStyle = band.colour; c.beginPath();
        for (let k = 0; k < band.x.length; k++) if (band.low[k] === band.low[k]) c.lineTo(X(band.x[k]), Y(band.low[k]));
        for (let k = band.x.length - 1; k >= 0; k--) if (band.high[k] === band.high[k]) c.lineTo(X(band.x[k]), Y(band.high[k]));
        c.fill(); }
      if (this.data.zero) { c.fillStyle = this.data.zero; c.fillRect(b.left, Y(0) - r / 2, b.width, r); }
      for (const line of this.lines) { if (!this.shown(line)) continue;
        if (line.outside && this.bands.length) this.fill(c, line, this.bands[0], X, Y);
        c.strokeStyle = c.fillStyle = line.colour; c.lineWidth = 1.3 * line.width * r; c.lineJoin = "round"; c.beginPath();
        let pen = false;
        for (let k = 0; k < line.x.length; k++) { const x = line.x[k], y = line.y[k];
          if (x !== x || y !== y) { pen = false; continue; }
          if (pen) c.lineTo(X(x), Y(y)); else c.moveTo(X(x), Y(y)); pen = true; }
        if (line.width) c.stroke();
        const d = 1.3 * line.dot * r;
        if (d) for (let k = 0; k < line.x.length; k++) { if (line.x[k] !== line.x[k] || line.y[k] !== line.y[k]) continue;
          c.beginPath(); c.arc(X(line.x[k]), Y(line.y[k]), d / 2, 0, 7); c.fill(); } }
      c.restore();
    }
    fill(c, line, band, X, Y) {
      const out = k => line.y[k] < band.low[k] || line.y[k] > band.high[k];
      c.fillStyle = `${line.outside}bf`;
      for (let k = 1; k < line.x.length; k++) { if (!out(k - 1) || !out(k)) continue;
        c.beginPath(); c.moveTo(X(line.x[k - 1]), Y(0)); c.lineTo(X(line.x[k - 1]), Y(line.y[k - 1]));
        c.lineTo(X(line.x[k]), Y(line.y[k])); c.lineTo(X(line.x[k]), Y(0)); c.fill(); }
    }
    point(u) {
      const {left, top} = u.cursor; this.tip.hidden = true;
      if (left === undefined || left < 0 || top < 0) return;
      const fx = u.over.clientWidth / (this.view.x[1] - this.view.x[0]), fy = u.over.clientHeight / (this.view.y[1] - this.view.y[0]);
      const x = u.posToVal(left, "x"), y = u.posToVal(top, "y"); let best = null, near = NEAR * NEAR;
      for (const line of this.lines) { if (!this.shown(line)) continue;
        for (let k = 0; k < line.x.length; k++) { const dx = (line.x[k] - x) * fx, dy = (line.y[k] - y) * fy, d = dx * dx + dy * dy;
          if (d < near) { near = d; best = [line, k]; } } }
      if (!best) return;
      const [line, k] = best;
      this.tip.textContent = `${line.run ? `${line.run}: ` : ""}${line.name}\n${this.data.y.names.length ? "" : `${words(line.y[k], this.data.y)}\n`}${words(line.x[k], this.data.x)}`;
      this.tip.hidden = false;
      const right = left > u.over.clientWidth / 2;
      this.tip.style.left = right ? "" : `${u.over.offsetLeft + left + 12}px`;
      this.tip.style.right = right ? `${this.hold.clientWidth - u.over.offsetLeft - left + 12}px` : "";
      this.tip.style.top = `${u.over.offsetTop + top + 8}px`;
    }
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
      const group = make("details", {class: "switches"}); group.append(make("summary", {}, `${title} (${parts.size})`));
      const boxes = [...parts].map(([name, colour]) => {
        const label = make("label"), box = make("input", {type: "checkbox"}); box.checked = true;
        box.addEventListener("change", () => { box.checked ? off.delete(`${kind} ${name}`) : off.add(`${kind} ${name}`); refresh(); });
        label.append(box); if (kind === "name") { const swatch = make("i"); swatch.style.background = colour; label.append(swatch); }
        label.append(document.createTextNode(name)); group.append(label); return box; });
      const every = make("button", {type: "button"}, "all or none");
      every.addEventListener("click", () => { const to = !boxes.every(box => box.checked);
        for (const box of boxes) if (box.checked !== to) box.click(); });
      group.append(every); return group; };
    const parts = panels.flatMap(p => [...p.lines, ...p.bands]), runs = new Map(), names = new Map();
    for (const part of parts) { if (part.run) runs.set(part.run, ""); if (!names.has(part.name)) names.set(part.name, part.colour); }
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
    live.append(bar, grid); figure.querySelector("img").after(live); figure.classList.add("live");
    const few = panels.length < 3 * step;
    if (few) grid.classList.add("few");
    panels.forEach((p, k) => p.build(k % step === 1 ? (few ? 170 : 130) : few ? 340 : 230));
  }

  PliantParts.whenSeen("figure[data-chart]", chart);
})();
