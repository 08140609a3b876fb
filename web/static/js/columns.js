// <column-map>: which columns of a table are what. The server guesses and reads the beginning as said here; a person corrects and confirms.
import { request, showProblem } from "./common/api.js";
import { h, icon } from "./common/elements.js";
import { fixed, localise, speak, translate } from "./common/words.js";
import { letGo } from "./forms.js";

const WAIT_MS = 300;
const THE_FILE = "*"; // a sensor that no column names is called as its file
const AXES = { acc: "xyz", gyr: "xyz", mag: "xyz", quat: "wxyz" };
const NAMES = {
  acc: (axis) => speak`Acceleration ${axis}`, gyr: (axis) => speak`Angular rate ${axis}`,
  mag: (axis) => speak`Magnetic field ${axis}`, quat: (axis) => speak`Quaternion ${axis}`,
};
const SHOWN = 3;
const SAME = { "m/s^2": "m/s2", "m/s²": "m/s2", "°/s": "deg/s", "µs": "us" }; // units that a manifest may write in two ways
const SHOWN_KEYS = ["rate_hz", "time_column", "time_unit", "counter", "acc_unit", "gyr_unit", "quat_order"]; // all else of an entry is kept
const DEG = 180 / Math.PI;

const roles = () => [
  ["", speak`Not used`], ["time", speak`Time`], ["counter", speak`Sample counter`],
  ...Object.entries(AXES).flatMap(([kind, axes]) => [...axes].map((axis) => [`${kind} ${axis}`, NAMES[kind](axis)])),
];

/** @param {string[][]} options @param {string} value @param {Record<string, any>} attributes */
function select(options, value, attributes) {
  const made = /** @type {HTMLSelectElement} */ (h("select", { class: "select sm", ...attributes }, ...options.map(([v, t]) => h("option", { value: v }, t))));
  made.value = SAME[value] ?? value ?? "";
  return made;
}

// One shape of tables: its columns as rows, its units, what the server finds when it reads them so.
class Shape {
  constructor(found, onchange) {
    this.found = found;
    const { source } = found;
    const said = new Map();
    for (const [sensor, kinds] of Object.entries(source.columns)) {
      for (const [kind, names] of Object.entries(kinds)) names?.forEach((name, i) => said.set(name, [`${kind} ${AXES[kind][i]}`, sensor]));
    }
    if (source.quat_order === "xyzw") for (const [name, [role, sensor]] of said) said.set(name, [role.replace(/^quat (.)$/, (_, a) => `quat ${"xyzw"["wxyz".indexOf(a)]}`), sensor]);
    if (source.time_column) said.set(source.time_column, ["time", ""]);
    if (source.counter) said.set(source.counter.column, ["counter", ""]);
    this.rows = found.names.map((name, i) => this.row(name, i, said.get(name) ?? ["", ""]));
    this.rate = /** @type {HTMLInputElement} */ (h("input", { class: "input", type: "number", min: 1, max: 10000, step: "any", value: source.rate_hz ?? source.counter?.rate_hz, "data-rate": true }));
    this.acc = select([["", "?"], ["m/s2", "m/s²"], ["g", "g"], ["mg", "mg"]], source.acc_unit, { "data-acc-unit": true });
    this.gyr = select([["", "?"], ["rad/s", "rad/s"], ["deg/s", "°/s"]], source.gyr_unit, { "data-gyr-unit": true });
    this.time = select(["s", "ms", "us", "ns"].map((u) => [u, u === "us" ? "µs" : u]), source.time_unit ?? "s", {});
    this.checks = h("ul", { class: "plainlist stack g2 small" });
    this.element = this.draw();
    this.element.addEventListener("input", onchange);
  }

  row(name, i, [role, sensor]) {
    const values = this.found.rows.slice(0, SHOWN).map((cells) => cells[i] ?? "").join(" · ");
    const what = select(roles(), role, { "aria-label": speak`Meaning of column ${name}` });
    const whose = /** @type {HTMLInputElement} */ (h("input", { class: "input sm", value: sensor === THE_FILE ? "" : sensor, placeholder: speak`as in the file`, "aria-label": speak`Sensor of column ${name}`, maxlength: 64 }));
    const row = { name, what, whose, element: null };
    const show = () => { whose.hidden = !what.value.includes(" "); };
    what.addEventListener("input", show);
    show();
    row.element = h("tr", {}, h("td", { class: "wrapany" }, name), h("td", { class: "mono xs dim hide-sm" }, values), h("td", {}, what), h("td", {}, whose));
    return row;
  }

  draw() {
    const { files, basis } = this.found;
    const field = (label, input, help) => h("label", { class: "field" }, h("span", { class: "label" }, label), input, help ? h("span", { class: "help" }, help) : null);
    const why = { known: speak`Taken from a previous table of this layout. Correct if necessary.`, said: speak`As set before. Correct if necessary.` };
    const title = files.length === 1 ? files[0] : speak`${files[0]} and ${files.length - 1} more`;
    return h("div", { class: "stack g3", "data-shape": true },
      h("h3", { class: "wrapany" }, title),
      h("p", { class: "small mut" }, why[basis] ?? speak`Suggested from names and values. Correct if necessary.`),
      h("div", { class: "scroll" }, h("table", { class: "tbl tight" },
        h("thead", {}, h("tr", {}, h("th", {}, speak`Column`), h("th", { class: "hide-sm" }, speak`First values`), h("th", {}, speak`Meaning`), h("th", {}, speak`Sensor`))),
        h("tbody", {}, ...this.rows.map((r) => r.element)))),
      h("div", { class: "grid cols2 measures" },
        field(speak`Samples per second`, this.rate, speak`Required if there is no time column.`),
        field(speak`Time unit`, this.time, ""),
        field(speak`Acceleration unit`, this.acc, ""), field(speak`Angular rate unit`, this.gyr, "")),
      h("div", { role: "status" }, this.checks));
  }

  // Says which two columns were given the same role; "" where each role has one column.
  conflict() {
    const taken = new Map();
    for (const { name, what, whose } of this.rows) {
      if (!what.value) continue;
      const role = what.value.includes(" ") ? JSON.stringify([what.value, whose.value.trim()]) : what.value;
      if (taken.has(role)) return speak`${what.selectedOptions[0].text} is assigned to columns ${taken.get(role)} and ${name}. Choose one of them.`;
      taken.set(role, name);
    }
    return "";
  }

  // The entry of the manifest, without the file.
  source() {
    const source = { ...this.found.source, columns: {} };
    for (const key of SHOWN_KEYS) delete source[key];
    const rate = parseFloat(this.rate.value.replace(",", "."));
    if (Number.isFinite(rate)) source.rate_hz = rate;
    for (const { name, what, whose } of this.rows) {
      const [kind, axis] = what.value.split(" ");
      if (kind === "time") Object.assign(source, { time_column: name, time_unit: this.time.value });
      else if (kind === "counter") source.counter = { column: name, wrap: this.found.source.counter?.wrap };
      else if (axis) ((source.columns[whose.value.trim() || THE_FILE] ??= {})[kind] ??= [])[AXES[kind].indexOf(axis)] = name;
    }
    const kinds = Object.values(source.columns);
    for (const kind of kinds) for (const [name, columns] of Object.entries(kind)) kind[name] = Array.from({ length: AXES[name].length }, (_, i) => columns[i] ?? "");
    if (kinds.some((k) => k.quat)) source.quat_order = "wxyz";
    if (this.acc.value) source.acc_unit = this.acc.value;
    if (this.gyr.value && kinds.some((k) => k.gyr)) source.gyr_unit = this.gyr.value;
    return source;
  }

  show(checks) {
    const said = (c) => [
      `${c.sensor}: ${localise(String(c.rate_hz))} Hz`,
      c.at_rest_mps2 === null ? speak`never at rest` : speak`at rest ${fixed(c.at_rest_mps2, 2)} m/s²`,
      c.fastest_radps === null ? "" : speak`up to ${Math.round(c.fastest_radps * DEG)} °/s`,
    ].filter(Boolean).join(" · ");
    this.checks.replaceChildren(...checks.map((c) => h("li", { "data-check": c.problems.length ? "warn" : "ok" },
      icon(c.problems.length ? "warn" : "check"), " ", said(c), ...c.problems.map((p) => h("p", { class: "small" }, translate(p))))));
  }

  refuse(problem) {
    // the server speaks of the manifest, whose words nobody sees here
    const said = problem.code === "rate_missing" ? speak`Enter the sampling rate or select the time column.` : translate(problem.detail || problem.title);
    this.checks.replaceChildren(h("li", { "data-check": "bad" }, icon("bad"), " ", said));
  }
}

class ColumnMap extends HTMLElement {
  async connectedCallback() {
    this.base = `/api/v1/sessions/${this.getAttribute("session")}`;
    this.note = this.querySelector(".form-error");
    this.button = this.querySelector("[data-read]");
    this.button.addEventListener("click", () => this.read());
    try {
      const found = await request("GET", `${this.base}/tables`);
      this.shapes = found.map((shape) => {
        const made = new Shape(shape, () => this.check(made, WAIT_MS));
        return made;
      });
    } catch (problem) {
      this.hidden = false;
      showProblem(this.note, problem);
      return;
    }
    this.hidden = this.shapes.length === 0;
    if (!this.hidden) document.querySelector("[data-inspect]")?.classList.remove("primary"); // one way is the first
    this.querySelector("[data-shapes]").replaceChildren(...this.shapes.map((s) => s.element));
    for (const shape of this.shapes) this.check(shape, 0);
  }

  // The newest answer counts; the button waits for it.
  check(shape, waitMs) {
    clearTimeout(shape.timer);
    shape.fits = false;
    this.able();
    const conflict = shape.conflict();
    if (conflict) {
      shape.asked = null; // an answer that is still on its way is for another choice
      shape.refuse({ detail: conflict });
      return;
    }
    shape.timer = setTimeout(async () => {
      const asked = (shape.asked = {});
      try {
        const checks = await request("POST", `${this.base}/tables/checks`, { file: shape.found.files[0], source: shape.source() });
        if (shape.asked !== asked) return;
        shape.show(checks);
        shape.fits = true;
      } catch (problem) {
        if (shape.asked !== asked) return;
        shape.refuse(problem);
      }
      this.able();
    }, waitMs);
  }

  able() { this.button.disabled = !this.shapes.every((s) => s.fits); }

  async read() {
    this.button.disabled = true;
    try {
      for (const shape of this.shapes) await request("PUT", `${this.base}/tables`, { files: shape.found.files, source: shape.source() });
      await request("POST", `${this.base}/inspections`);
      letGo();
      location.reload();
    } catch (problem) {
      this.able();
      showProblem(this.note, problem);
    }
  }
}
customElements.define("column-map", ColumnMap);
