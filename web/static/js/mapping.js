// <sensor-map>: which sensor is on which segment. The selects are the truth; the body is a second way to set them.
import { request, showProblem } from "./common/api.js";
import { s } from "./common/elements.js";
import { letGo } from "./forms.js";
import { SIDE_KEY, SIDE_LETTER, plural, sideOf, speak } from "./common/words.js";

const PLACES = {
  pelvis: [150, 236], thigh_r: [121, 312], thigh_l: [179, 312], shank_r: [123, 412], shank_l: [177, 412],
  foot_r: [116, 484], foot_l: [184, 484], chest: [150, 130],
};

class SensorMap extends HTMLElement {
  connectedCallback() {
    this.rows = [...this.querySelectorAll("tr[data-device]")];
    this.layer = this.querySelector("[data-sensors]");
    this.selected = null;
    for (const row of this.rows) {
      row.querySelector("select").addEventListener("change", () => this.draw());
      row.addEventListener("click", () => this.select(row));
      row.addEventListener("focusin", () => this.select(row));
    }
    this.measures = [...this.querySelectorAll("[data-measure]")];
    this.protocol = this.querySelector("select[name=protocol]");
    this.protocol?.addEventListener("change", () => {
      this.querySelector("[data-belt]").hidden = this.protocol.value !== "treadmill";
      this.draw();
    });
    this.ask = this.querySelector("[data-ask]");
    // the page comes with its buttons off: a tap before the script is there would be lost
    const swap = this.querySelector("[data-swap]"); // only for who may analyse
    swap?.addEventListener("click", () => this.swap());
    if (swap) swap.disabled = false;
    const clear = this.querySelector("[data-clear]");
    clear?.addEventListener("click", () => this.clear());
    if (clear) clear.disabled = false;
    for (const b of this.querySelectorAll("[data-sides]")) {
      b.disabled = false;
      b.addEventListener("click", () => {
        if (b.dataset.sides === "swap") this.swap();
        this.answered();
      });
    }
    this.querySelector("[data-analyse]")?.addEventListener("click", (e) => this.analyse(e.target.closest("button")));
    this.draw();
  }

  segment(row) { return row.querySelector("select").value; }
  name(segment) { return this.rows[0].querySelector(`option[value="${segment}"]`).textContent; }

  select(row) {
    if (this.selected === row) return;
    this.selected = row;
    for (const r of this.rows) r.classList.toggle("on", r === row);
    this.draw();
  }

  swap() {
    for (const row of this.rows) {
      const select = row.querySelector("select");
      const side = sideOf(select.value);
      if (side) select.value = select.value.slice(0, -1) + (side === "left" ? "r" : "l");
    }
    this.draw();
  }

  // The places of an earlier take are not those of this one.
  clear() {
    for (const row of this.rows) row.querySelector("select").value = "";
    this.querySelector("[data-as-before]").remove();
    this.draw();
    this.rows[0].querySelector("select").focus();
  }

  // The side of a leg was a try: nothing is analysed before a person has said which leg it is.
  answered() {
    this.ask?.remove();
    this.ask = null;
    this.draw();
    this.querySelector("[data-analyse]")?.focus();
  }

  place(segment) {
    const there = this.rows.find((r) => this.segment(r) === segment);
    if (there && there !== this.selected) return this.select(there);
    if (!this.selected || there) return;
    this.selected.querySelector("select").value = segment;
    this.draw();
  }

  draw() {
    const focused = this.layer.contains(document.activeElement) ? document.activeElement.getAttribute("data-segment") : null;
    const worn = new Map();
    const clashes = new Set();
    for (const row of this.rows) {
      const segment = this.segment(row);
      const side = row.querySelector("[data-side]");
      side.className = `lr ${SIDE_KEY[sideOf(segment)] ?? "none"}`;
      side.textContent = SIDE_LETTER[sideOf(segment)] ?? "–";
      row.classList.toggle("unused", !segment);
      if (!segment) continue;
      if (worn.has(segment)) clashes.add(segment);
      worn.set(segment, row);
    }
    this.layer.replaceChildren();
    for (const [segment, [x, y]] of Object.entries(PLACES)) this.mark(segment, x, y, worn.get(segment), clashes.has(segment));
    if (focused) this.layer.querySelector(`[data-segment=${focused}]`)?.focus();
    this.report(worn, clashes);
  }

  mark(segment, x, y, row, clash) {
    const on = row && row === this.selected ? " on" : "";
    const kind = row ? `sens ${SIDE_KEY[sideOf(segment)] ?? "c"}${clash ? " warn" : ""}${on}` : "slotg";
    const what = row ? speak`sensor ${row.dataset.number}` : speak`no sensor`;
    const marks = row
      ? [
          s("rect", { x: x - 14, y: y - 14, width: 28, height: 28, rx: 7 }),
          s("text", { x, y: y + 4.5, "text-anchor": "middle" }, row.dataset.number),
        ]
      : [s("rect", { class: "slot", x: x - 13, y: y - 13, width: 26, height: 26, rx: 6 })];
    const act = (e) => {
      if (e.key !== "Enter" && e.key !== " ") return;
      e.preventDefault();
      this.place(segment);
    };
    this.layer.append(
      s(
        "g",
        {
          class: kind, tabindex: 0, role: "button", "data-segment": segment, "aria-label": `${this.name(segment)}: ${what}`,
          onclick: () => this.place(segment), onkeydown: act,
        },
        s("circle", { class: "hit", cx: x, cy: y, r: 26 }),
        ...marks,
      ),
    );
  }

  // The protocol of the visit, as chosen here.
  done() { return this.protocol?.value ?? this.getAttribute("protocol"); }

  // What the movement needs and nobody wears.
  lacks(worn) {
    if (this.done() === "squat") {
      const leg = ["l", "r"].some((side) => worn.has(`thigh_${side}`) && worn.has(`shank_${side}`));
      return leg && worn.has("pelvis") ? "" : speak`; a squat requires shank, thigh and pelvis sensors`;
    }
    return worn.has("foot_l") && worn.has("foot_r") ? "" : speak`; strides require sensors on both feet`;
  }

  report(worn, clashes) {
    const clash = this.querySelector("[data-clash]");
    clash.hidden = clashes.size === 0;
    if (clashes.size) {
      clash.querySelector("[data-title]").textContent = speak`Two sensors on one segment: ${[...clashes].map((segment) => this.name(segment)).join(", ")}`;
      clash.querySelector("[data-detail]").textContent = speak`Each segment can have only one sensor. Set the other one to Not used.`;
    }
    if (this.ask) {
      const row = worn.get("foot_l");
      this.ask.hidden = !row;
      if (row) {
        this.ask.querySelector("[data-ask-number]").textContent = row.dataset.number;
        this.ask.querySelector("[data-ask-id]").textContent = row.dataset.device;
      }
    }
    const lacks = worn.size ? this.lacks(worn) : "";
    const sum = this.querySelector("[data-sum]");
    const asked = this.ask && !this.ask.hidden;
    sum.textContent = asked ? speak`First indicate which foot is the left one` : plural(this.rows.length, speak`${worn.size} of ${this.rows.length} sensor assigned${lacks}`, speak`${worn.size} of ${this.rows.length} sensors assigned${lacks}`);
    const button = this.querySelector("[data-analyse]");
    if (button) button.disabled = worn.size === 0 || clashes.size > 0 || Boolean(asked);
  }

  manifest() {
    const manifest = JSON.parse(this.getAttribute("manifest") || "{}") || {};
    manifest.sensors = Object.fromEntries(this.rows.map((r) => [r.dataset.device, this.segment(r) || null]));
    for (const input of this.measures) put(manifest, input.name.split("."), parseFloat(input.value.replace(",", ".")));
    if (this.protocol) delete manifest.protocol; // the visit's counts
    if (this.done() !== "treadmill") delete manifest.belt_speed_mps;
    return manifest;
  }

  async analyse(button) {
    const session = this.getAttribute("session");
    if (!this.measures.every((input) => input.reportValidity())) return;
    button.disabled = true;
    try {
      if (this.done() !== this.getAttribute("protocol")) await request("PATCH", `/api/v1/sessions/${session}`, { protocol: this.done() });
      await request("POST", `/api/v1/sessions/${session}/analyses`, { manifest: this.manifest() });
      letGo();
      location.assign(`/sessions/${session}`);
    } catch (problem) {
      button.disabled = false;
      showProblem(this.querySelector(".form-error"), problem);
    }
  }
}
// "subject.shoe.back_m" goes three levels deep; a field left empty takes its place away.
/** @param {string[]} path */
function put(into, path, value) {
  const [first, ...rest] = path;
  if (rest.length) {
    const inner = into[first] ?? {};
    put(inner, rest, value);
    if (Object.keys(inner).length) into[first] = inner;
    else delete into[first];
  } else if (Number.isFinite(value)) into[first] = value;
  else delete into[first];
}

customElements.define("sensor-map", SensorMap);
