"use strict";
// A body in space, drawn into a depth buffer: pieces are bent, mirrored and placed as each state says, then turned to the viewer.
(() => {
  const {make, unpack} = PliantParts, SHARP = 0.75, STEP = 0.12, CALM = 160, LAMPS = [[-0.45, 0.65, 0.75, 0.5], [0.75, 0.1, 0.55, 0.16]];
  const AMBIENT = 0.5, HEIGHT = 460, UNKNOWN = 200, KEYS = "Arrows turn it, plus and minus zoom, 0 shows it as at first.";
  const lamps = LAMPS.map(([x, y, z, s]) => { const n = Math.hypot(x, y, z); return [x / n, y / n, z / n, s]; });

  // Triangles of some faces of a skin; a node is there twice where faces meet at a sharp edge.
  function mesh(skin, faces) {
    const at = id => [0, 1, 2].map(j => skin.points[3 * id + j]), minus = (a, b) => a.map((v, j) => v - b[j]);
    const ids = [], own = new Map(), corners = [], flat = [[], []];
    for (let f = 0; f < faces.length; f += 9) {
      const q = faces.slice(f, f + 9), [a, b, c, d] = [q[0], q[2], q[6], q[8]].map(at), u = minus(d, a), v = minus(c, b);
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], size = Math.hypot(...n) || 1;
      const unit = n.map(w => w / size);
      const here = q.map(id => { const known = own.get(id) || []; own.set(id, known);
        let found = known.find(one => one.n[0] * unit[0] + one.n[1] * unit[1] + one.n[2] * unit[2] > SHARP);
        if (!found) { found = {n: unit, k: ids.length}; ids.push(id); known.push(found); }
        return found.k; });
      for (const [i, j] of [[0, 0], [1, 0], [0, 1], [1, 1]]) { const p = i + 3 * j;
        corners.push(here[p], here[p + 1], here[p + 4], here[p], here[p + 4], here[p + 3]); }
    }
    return {ids: Int32Array.from(ids), corners};
  }

  class Scene {
    constructor(figure, data = PliantParts.data(figure)) {
      this.figure = figure; this.still = figure.querySelector("img"); this.take(data);
      this.state = data.states.length - 1; this.load = data.load; this.view = data.views[0] || ""; this.colouring = data.colourings[0]; this.home(); this.controls(); this.gather();
    }
    take(data) {
      const lists = data.lists.map(unpack); this.data = data;
      for (const skin of data.skins) { skin.points = lists[skin.points]; skin.length = lists[skin.length]; skin.n = skin.points.length / 3 / skin.levels; skin.meshes = {};
        for (const name in skin.values) skin.values[name] = lists[skin.values[name]]; }
      for (const body of data.bodies) { for (const key of ["level", "angle", "rotation", "centre"]) body[key] = lists[body[key]];
        for (const name in body.values) body.values[name] = lists[body.values[name]]; }
    }
    // The same robot as another model has it: what is looked at, and from where, stays.
    retake(data) {
      const {middle, radius} = this.data; this.take(data);
      if (radius >= 0.8 * data.radius && radius <= 2 * data.radius) Object.assign(data, {middle, radius});
      this.colouring = data.colourings.find(one => one.name === this.colouring.name) || data.colourings[0]; this.load = Math.min(this.load, Math.max(data.loads.length - 1, 0));
      this.slider.max = data.states.length - 1; this.legend(); this.gather(); this.show(this.state);
    }
    home() { this.turned = Float64Array.from(this.data.camera); this.zoomed = 1; }

    // The triangles of the present view, in one list over all bodies.
    gather() {
      const blocks = [], corners = []; let n = 0;
      for (const body of this.data.bodies) for (const copy of body.copies) {
        if (copy.view && copy.view !== this.view) continue;
        const skin = this.data.skins[body.skin], part = skin.meshes[copy.faces] || (skin.meshes[copy.faces] = mesh(skin, skin.faces[copy.faces]));
        const [x, y, z] = copy.signs, turned = x * y * z < 0;
        blocks.push({body, skin, ids: part.ids, signs: copy.signs, first: n});
        for (let k = 0; k < part.corners.length; k += 3) { const [a, b, c] = part.corners.slice(k, k + 3); corners.push(n + a, n + (turned ? c : b), n + (turned ? b : c)); }
        n += part.ids.length;
      }
      this.blocks = blocks; this.corners = Int32Array.from(corners); this.n = n;
      this.points = new Float32Array(3 * n); this.normals = new Float32Array(3 * n); this.shades = new Float32Array(n);
      this.seen = new Float32Array(3 * n); this.light = new Float32Array(n); this.place(); this.soon();
    }
    // Where every node is in this state, which way the surface looks there, and its value between the ends of the colours.
    place() {
      const P = this.points, k = this.state + this.load * this.data.states.length, {name, limits: [low, high]} = this.colouring, one = 1 / ((high - low) || 1);
      for (const {body, skin, ids, signs, first} of this.blocks) {
        const level = body.level[k], l0 = Math.max(0, Math.min(skin.levels - 1, Math.floor(level))), l1 = Math.min(l0 + 1, skin.levels - 1), w = level - l0;
        const A = skin.points, a = 3 * skin.n * l0, b = 3 * skin.n * l1, turn = body.angle[k], R = body.rotation, r = 9 * k, C = body.centre, c = 3 * k;
        const length = (1 - w) * skin.length[l0] + w * skin.length[l1], radius = Math.abs(turn) < 1e-7 ? 0 : length / turn;
        const values = skin.values[name], whole = values ? 0 : body.values[name] ? (body.values[name][k] - low) * one : 0;
        for (let i = 0; i < ids.length; i++) {
          const p = 3 * ids[i], q = 3 * (first + i), s = (1 - w) * A[a + p] + w * A[b + p];
          let x = s, y = (1 - w) * A[a + p + 1] + w * A[b + p + 1], z = (1 - w) * A[a + p + 2] + w * A[b + p + 2];
          if (radius) { const angle = s / radius, out = radius + z; x = out * Math.sin(angle); z = out * Math.cos(angle) - radius; }
          x *= signs[0]; y *= signs[1]; z *= signs[2];
          for (let j = 0; j < 3; j++) P[q + j] = R[r + 3 * j] * x + R[r + 3 * j + 1] * y + R[r + 3 * j + 2] * z + C[c + j];
          this.shades[first + i] = values ? ((1 - w) * values[skin.n * l0 + ids[i]] + w * values[skin.n * l1 + ids[i]] - low) * one : whole;
        }
      }
      const N = this.normals.fill(0), T = this.corners;
      for (let t = 0; t < T.length; t += 3) {
        const a = 3 * T[t], b = 3 * T[t + 1], c = 3 * T[t + 2], ux = P[b] - P[a], uy = P[b + 1] - P[a + 1], uz = P[b + 2] - P[a + 2];
        const vx = P[c] - P[a], vy = P[c + 1] - P[a + 1], vz = P[c + 2] - P[a + 2], x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
        for (const q of [a, b, c]) { N[q] += x; N[q + 1] += y; N[q + 2] += z; }
      }
    }

    soon() {
      clearTimeout(this.later); cancelAnimationFrame(this.next);
      this.next = requestAnimationFrame(() => { this.paint(1); this.later = setTimeout(() => this.paint(2), CALM); });
    }
    // `fine`: pixels drawn for one of the screen, each way.
    paint(fine) {
      const wide = this.canvas.clientWidth, high = this.canvas.clientHeight; if (!wide) return;
      const W = Math.round(wide * fine), H = Math.round(high * fine), V = this.turned, M = this.data.middle, P = this.points, N = this.normals, S = this.seen;
      const scale = this.scale = 0.94 * Math.min(W, H) / 2 / this.data.radius * this.zoomed;
      for (let i = 0, q = 0; i < this.n; i++, q += 3) {
        const x = P[q] - M[0], y = P[q + 1] - M[1], z = P[q + 2] - M[2], size = Math.hypot(N[q], N[q + 1], N[q + 2]) || 1;
        S[q] = W / 2 + scale * (V[0] * x + V[1] * y + V[2] * z); S[q + 1] = H / 2 - scale * (V[3] * x + V[4] * y + V[5] * z); S[q + 2] = V[6] * x + V[7] * y + V[8] * z;
        const nx = (V[0] * N[q] + V[1] * N[q + 1] + V[2] * N[q + 2]) / size, ny = (V[3] * N[q] + V[4] * N[q + 1] + V[5] * N[q + 2]) / size, nz = (V[6] * N[q] + V[7] * N[q + 1] + V[8] * N[q + 2]) / size;
        let light = AMBIENT; for (const [lx, ly, lz, s] of lamps) light += s * Math.max(0, nx * lx + ny * ly + nz * lz);
        this.light[i] = light;
      }
      const image = new ImageData(W, H), out = new Uint32Array(image.data.buffer).fill(0xffffffff);
      this.fill(W, H, out);
      this.canvas.width = W; this.canvas.height = H;
      const c = this.canvas.getContext("2d"); c.putImageData(image, 0, 0); this.frame(c, W, H, fine);
      this.box.dataset.drawn = `${this.state} ${this.view} ${this.colouring.name} ${Array.from(V, v => v.toFixed(3)).join(" ")} ${this.zoomed.toFixed(3)}${this.data.loads.length ? ` load ${this.load}` : ""}`;
    }
    // Every triangle that looks this way, nearest first by the depth of each pixel.
    fill(W, H, out) {
      const depth = new Float32Array(W * H).fill(-Infinity), S = this.seen, T = this.corners, L = this.light, D = this.shades, ramp = this.ramp();
      for (let t = 0; t < T.length; t += 3) {
        const i = T[t], j = T[t + 1], k = T[t + 2], ax = S[3 * i], ay = S[3 * i + 1], bx = S[3 * j], by = S[3 * j + 1], cx = S[3 * k], cy = S[3 * k + 1];
        const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax); if (area >= 0) continue;
        const x0 = Math.max(0, Math.ceil(Math.min(ax, bx, cx) - 0.5)), x1 = Math.min(W - 1, Math.floor(Math.max(ax, bx, cx) - 0.5)), y0 = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5)), y1 = Math.min(H - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
        const az = S[3 * i + 2], bz = S[3 * j + 2] - az, cz = S[3 * k + 2] - az, al = L[i], bl = L[j] - al, cl = L[k] - al, ad = D[i], bd = D[j] - ad, cd = D[k] - ad;
        const vx = (cy - ay) / area, vy = -(cx - ax) / area, wx = -(by - ay) / area, wy = (bx - ax) / area;
        for (let y = y0; y <= y1; y++) {
          let v = (x0 + 0.5 - ax) * vx + (y + 0.5 - ay) * vy, w = (x0 + 0.5 - ax) * wx + (y + 0.5 - ay) * wy;
          for (let x = x0, p = y * W + x0; x <= x1; x++, p++, v += vx, w += wx) {
            if (v < 0 || w < 0 || v + w > 1) continue;
            const z = az + v * bz + w * cz; if (z <= depth[p]) continue;
            depth[p] = z;
            const shade = ad + v * bd + w * cd, at = 3 * (shade === shade ? Math.max(0, Math.min(255, Math.round(255 * shade))) : 256), light = al + v * bl + w * cl;
            out[p] = 0xff000000 | Math.min(255, ramp[at + 2] * light) << 16 | Math.min(255, ramp[at + 1] * light) << 8 | Math.min(255, ramp[at] * light);
          }
        }
      }
    }
    ramp() {
      const colours = this.colouring.colours.map(text => [1, 3, 5].map(k => parseInt(text.slice(k, k + 2), 16))), found = new Float32Array(3 * 257).fill(UNKNOWN);
      for (let k = 0; k < 256; k++) { const at = k / 255 * (colours.length - 1), low = Math.min(colours.length - 2, Math.floor(at)), w = at - low;
        for (let j = 0; j < 3; j++) found[3 * k + j] = (1 - w) * colours[low][j] + w * colours[low + 1][j]; }
      return found;
    }
    // Directions of the world, and a length.
    frame(c, W, H, fine) {
      const V = this.turned, x = 46 * fine, y = H - 46 * fine, reach = 30 * fine;
      c.strokeStyle = c.fillStyle = "#5c6577"; c.lineWidth = 1.5 * fine; c.font = `${12 * fine}px system-ui`; c.textAlign = "center"; c.textBaseline = "middle";
      ["x", "y", "z"].forEach((name, k) => { const dx = reach * V[k], dy = -reach * V[3 + k]; c.beginPath(); c.moveTo(x, y); c.lineTo(x + dx, y + dy); c.stroke();
        c.fillText(name, x + 1.3 * dx, y + 1.3 * dy); });
      const wanted = 0.2 * W / this.scale * 1e3, decade = 10 ** Math.floor(Math.log10(wanted)), mm = decade * [5, 2, 1].find(v => v * decade <= wanted), px = mm / 1e3 * this.scale;
      c.beginPath(); c.moveTo(W - px - 20 * fine, H - 16 * fine); c.lineTo(W - 20 * fine, H - 16 * fine); c.stroke(); c.fillText(`${Number(mm.toPrecision(1))} mm`, W - 20 * fine - px / 2, H - 28 * fine);
    }

    turn(dx, dy) {
      const [R, U, T] = [0, 3, 6].map(k => this.turned.slice(k, k + 3)), rotate = (a, b, by) => { const c = Math.cos(by), s = Math.sin(by);
        for (let k = 0; k < 3; k++) { const p = a[k], q = b[k]; a[k] = c * p + s * q; b[k] = c * q - s * p; } };
      rotate(R, T, -dx); rotate(U, T, dy); this.turned.set(R, 0); this.turned.set(U, 3); this.turned.set(T, 6); this.soon();
    }
    zoom(by) { this.zoomed = Math.max(0.4, Math.min(12, this.zoomed * by)); this.soon(); }
    show(k) { this.state = Math.max(0, Math.min(this.data.states.length - 1, k)); this.slider.value = this.state; const said = this.data.states[this.state];
      this.said.textContent = said; this.slider.setAttribute("aria-valuetext", said); this.place(); this.soon(); }
    key(name) {
      const does = {ArrowLeft: () => this.turn(-STEP, 0), ArrowRight: () => this.turn(STEP, 0), ArrowUp: () => this.turn(0, -STEP), ArrowDown: () => this.turn(0, STEP),
        "+": () => this.zoom(1.2), "=": () => this.zoom(1.2), "-": () => this.zoom(1 / 1.2), "0": () => { this.home(); this.soon(); }}[name];
      if (does) does(); return Boolean(does);
    }
    controls() {
      const data = this.data, bar = make("div", {class: "bar", role: "group", "aria-label": "view in space"}), live = make("div", {class: "chart"});
      const button = (text, does) => { const b = make("button", {type: "button"}, text); b.addEventListener("click", does); bar.append(b); return b; };
      const choice = (title, names, texts, does) => { if (names.length < 2) return; const label = make("label", {class: "choice"}, `${title} `), select = make("select");
        names.forEach((name, k) => select.append(make("option", {value: name}, texts[k]))); select.addEventListener("change", () => does(select.value)); label.append(select); bar.append(label); };
      this.slider = make("input", {type: "range", min: 0, max: data.states.length - 1, step: 1, value: this.state, "aria-label": data.slider});
      this.slider.addEventListener("input", () => { this.pause(); this.show(Number(this.slider.value)); }); this.said = make("output", {class: "state"});
      if (data.states.length > 1) { this.player = button("play", () => this.timer ? this.pause() : this.play()); const label = make("label", {class: "choice"}, `${data.slider} `); label.append(this.slider, this.said); bar.append(label); }
      if (data.loads.length > 1) { const said = make("output", {class: "state"}, data.loads[this.load]), label = make("label", {class: "choice"}, "load ");
        this.loadSlider = make("input", {type: "range", min: 0, max: data.loads.length - 1, step: 1, value: this.load, "aria-label": "load", "aria-valuetext": data.loads[this.load]});
        this.loadSlider.addEventListener("input", () => { this.load = Number(this.loadSlider.value); said.textContent = this.data.loads[this.load]; this.loadSlider.setAttribute("aria-valuetext", said.textContent); this.place(); this.soon(); });
        label.append(this.loadSlider, said); bar.append(label); }
      choice("colour", data.colourings.map(one => one.name), data.colourings.map(one => one.label), name => { this.colouring = this.data.colourings.find(one => one.name === name); this.legend(); this.place(); this.soon(); });
      choice("show", data.views, data.views, name => { this.view = name; this.gather(); });
      button("zoom in", () => this.zoom(1.2)); button("zoom out", () => this.zoom(1 / 1.2)); button("as at first", () => { this.home(); this.soon(); });
      const caption = this.still ? this.still.getAttribute("alt") : this.figure.getAttribute("aria-label");
      this.canvas = make("canvas", {tabindex: 0, role: "img", "aria-label": `${caption} In space. ${KEYS}`});
      this.scalebar = make("div", {class: "colours"}); this.box = make("div", {class: "space"}); this.box.append(this.canvas, this.scalebar); live.append(bar, this.box);
      if (this.still) this.still.after(live); else this.figure.prepend(live); this.figure.classList.add("live");
      if (data.beside) this.figure.classList.add("beside");
      else { const still = button("still picture", () => { const to = this.figure.classList.toggle("live"); this.box.hidden = !to; still.setAttribute("aria-pressed", String(!to)); if (to) this.soon(); }); still.setAttribute("aria-pressed", "false"); }
      this.canvas.style.height = `${HEIGHT}px`; this.pointers(); this.legend();
      this.said.textContent = data.states[this.state]; this.slider.setAttribute("aria-valuetext", data.states[this.state]);
      new ResizeObserver(() => this.soon()).observe(this.canvas);
    }
    legend() {
      const {label, limits, colours} = this.colouring, short = v => String(Number(v.toPrecision(3))), stripe = make("i");
      stripe.style.background = `linear-gradient(to right, ${colours.join(", ")})`; this.scalebar.replaceChildren(make("span", {}, short(limits[0])), stripe, make("span", {}, short(limits[1])), make("b", {}, label));
    }
    play() { this.player.textContent = "pause"; if (this.state >= this.data.states.length - 1) this.show(0);
      this.timer = setInterval(() => { if (this.state >= this.data.states.length - 1) this.pause(); else this.show(this.state + 1); }, Math.max(60, Math.min(400, 3000 / this.data.states.length))); }
    pause() { clearInterval(this.timer); this.timer = 0; if (this.player) this.player.textContent = "play"; }
    // A mouse turns both ways; a finger turns sideways, as up and down scrolls the page; two fingers zoom and tilt.
    pointers() {
      const held = new Map(), c = this.canvas;
      c.addEventListener("pointerdown", e => { held.set(e.pointerId, e); c.setPointerCapture(e.pointerId); });
      for (const end of ["pointerup", "pointercancel"]) c.addEventListener(end, e => held.delete(e.pointerId));
      c.addEventListener("pointermove", e => { const was = held.get(e.pointerId); if (!was) return; held.set(e.pointerId, e);
        const dx = (e.clientX - was.clientX) / 160, dy = (e.clientY - was.clientY) / 160;
        if (held.size === 2) { const other = [...held.values()].find(one => one.pointerId !== e.pointerId), far = one => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
          if (far(was) > 0) this.zoom(far(e) / far(was)); this.turn(0, dy / 2); } else this.turn(dx, e.pointerType === "touch" ? 0 : dy); });
      c.addEventListener("wheel", e => { if (document.activeElement !== c) return; e.preventDefault(); this.zoom(e.deltaY < 0 ? 1.1 : 1 / 1.1); }, {passive: false});
      c.addEventListener("keydown", e => { if (!e.ctrlKey && !e.metaKey && !e.altKey && this.key(e.key)) e.preventDefault(); });
    }
  }
  PliantParts.Scene = Scene;
  PliantParts.whenSeen("figure[data-scene]", figure => { figure.scene = new Scene(figure); });
})();
