"use strict";
// Tables of a report: sorted by a click on a heading, long ones folded.
(() => {
  const LONG = 15, SHOWN = 10;
  // "−1.2e-3 (…)" is −0.0012; what begins with no number stands last.
  const number = text => { const found = text.replace(/\u2212/g, "-").replace(/[\s\u00a0\u2009\u202f](?=\d{3})/g, "").match(/^[^\d-]{0,2}(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)/i);
    return found ? Number(found[1]) : NaN; };
  for (const table of document.querySelectorAll("main table")) {
    const body = table.tBodies[0], rows = [...body.rows], heads = [...table.tHead.rows[0].cells];
    if (rows.length < 2) continue;
    const show = () => [...body.rows].forEach((row, k) => row.classList.toggle("folded", folded && k >= SHOWN));
    let folded = rows.length > LONG;
    heads.forEach((head, column) => {
      if (!head.textContent) return;
      const button = document.createElement("button"); button.type = "button"; button.textContent = head.textContent;
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        const up = head.getAttribute("aria-sort") !== "ascending";
        const keyed = rows.map((row, place) => ({row, place, text: row.cells[column].textContent.trim()}));
        for (const one of keyed) one.value = number(one.text);
        const counts = keyed.filter(one => one.value === one.value).length > rows.length / 2;
        keyed.sort((a, b) => {
          if (counts && (a.value !== a.value || b.value !== b.value)) return (a.value !== a.value) - (b.value !== b.value) || a.place - b.place;
          return (up ? 1 : -1) * (counts ? a.value - b.value : a.text.localeCompare(b.text)) || a.place - b.place; });
        for (const other of heads) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", up ? "ascending" : "descending");
        body.append(...keyed.map(one => one.row)); show();
      });
    });
    if (!folded) continue;
    const more = document.createElement("button"); more.type = "button"; more.className = "more";
    const say = () => { more.textContent = folded ? `show all ${rows.length} rows` : `show ${SHOWN} rows`; more.setAttribute("aria-expanded", String(!folded)); };
    more.addEventListener("click", () => { folded = !folded; say(); show(); });
    table.parentElement.after(more); say(); show();
  }
})();
