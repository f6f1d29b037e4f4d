"use strict";
// The form that describes a robot: one part for each block of a study, fields as the installed kinds have them.
class RobotForm {
  // hold: the form; send(values): opens what was filled in.
  constructor(hold, ways, blocks, send) {
    this.ways = ways; this.blocks = blocks; this.way = null;
    hold.addEventListener("submit", event => { event.preventDefault(); send(this.values()); });
  }
  show(found) {
    this.found = found;
    this.ways.replaceChildren(...found.ways.map((one, k) => { const box = el("input", {type: "radio", name: "way", value: one.way, onchange: () => this.pick(one)});
      box.checked = this.way ? this.way.way === one.way : k === 0; return el("label", {}, box, ` ${one.words}`); }));
    this.pick(this.way ? found.ways.find(one => one.way === this.way.way) : found.ways[0]);
  }
  pick(way) {
    this.way = way; this.parts = {};
    const general = this.part("chain", "Chain", this.found.chain.filter(one => way.way !== "family" || !/^module_(length|mass)$/.test(one.name))
      .map(one => ({...one, required: one.name === "modules" || (one.name === "module_length" && way.way !== "family")})));
    const name = el("input", {type: "text", value: "robot", id: "robot-name", maxlength: 60}), weight = el("input", {type: "checkbox", id: "robot-weight"});
    weight.checked = true; this.name = name; this.weight = weight;
    const drive = way.way === "family" ? [this.part("fem", "What drives it: one of these", this.found.drives)] : [];
    const words = {family: "Module", material: "Material", surrogate: way.way === "data" ? "How the law is fitted" : "Law"};
    this.table = null;
    if (way.way === "data") this.table = el("select", {id: "robot-table"}, ...this.found.tables.map(one => el("option", {value: one}, one)));
    this.blocks.replaceChildren(
      el("fieldset", {}, el("legend", {}, "Robot"), this.row("name", "letters, digits, - and _", name), this.row("its weight acts", "", weight),
        this.table ? this.row("table of states", this.found.tables.length ? "" : "drop it first", this.table) : null),
      ...Object.entries(way.blocks).map(([key, kinds]) => this.block(key, words[key], kinds)), ...drive, general);
  }
  row(name, words, input) { return el("label", {class: "row"}, el("span", {}, name.replaceAll("_", " ")), input, el("span", {class: "soft"}, words)); }
  block(key, title, kinds) {
    const inner = el("div"), told = el("p", {class: "soft"});
    const select = el("select", {"aria-label": `kind of ${title}`, id: `robot-${key}-kind`}, ...kinds.map(one => el("option", {value: one.kind}, one.kind.replaceAll("_", " "))));
    const fill = () => { const one = kinds.find(k => k.kind === select.value) || kinds[0]; told.textContent = one ? one.summary : "";
      inner.replaceChildren(...this.inputs(key, one ? one.fields : [])); this.parts[key].kind = select; };
    this.parts[key] = {}; select.addEventListener("change", () => { this.parts[key] = {}; fill(); }); fill();
    return el("fieldset", {}, el("legend", {}, title), select, told, inner);
  }
  part(key, title, fields) { this.parts[key] = {}; return el("fieldset", {}, el("legend", {}, title), ...this.inputs(key, fields)); }
  inputs(key, fields) {
    return fields.map(one => { const id = `robot-${key}-${one.name}`;
      const input = one.choices.length ? el("select", {id}, ...one.choices.map(c => el("option", {value: c}, c)))
        : el("input", {type: "text", id, required: one.required, placeholder: one.default || (one.unit ? `… ${one.unit}` : ""), autocomplete: "off"});
      if (one.choices.length) input.value = one.default;
      this.parts[key][one.name] = input; return this.row(one.name, one.words, input); });
  }
  values() {
    const found = {way: this.way.way, name: this.name.value, weight: this.weight.checked, table: this.table ? this.table.value : ""};
    for (const [key, part] of Object.entries(this.parts)) found[key] = Object.fromEntries(Object.entries(part).map(([name, input]) => [name, input.value]));
    return found;
  }
}
