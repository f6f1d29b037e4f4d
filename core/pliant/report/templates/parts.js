"use strict";
// What the pictures of a report share.
const PliantParts = {
  make(tag, at, text) { const e = document.createElement(tag);
    for (const [k, v] of Object.entries(at || {})) e.setAttribute(k, v);
    if (text !== undefined) e.textContent = text; return e; },
  unpack(list) { const raw = atob(list.levels), out = new Float64Array(raw.length / 2);
    for (let k = 0; k < out.length; k++) { const code = raw.charCodeAt(2 * k) + 256 * raw.charCodeAt(2 * k + 1);
      out[k] = code === 65535 ? NaN : list.low + list.span * code / 65534; }
    return out; },
  data: figure => JSON.parse(figure.querySelector("script[type='application/json']").textContent),
  // Begins a picture when it is about to be seen.
  whenSeen(selector, begin) { const seen = new IntersectionObserver(entries => { for (const entry of entries) if (entry.isIntersecting) {
      seen.unobserve(entry.target); begin(entry.target); } }, {rootMargin: "300px"});
    for (const figure of document.querySelectorAll(selector)) seen.observe(figure); },
};
