// <live-sensors>: one row per sensor: segment, battery, loss, and its state as shape and word.
import { cell, segmentCell, setState, stateOf } from "./shapes.js";
import { number, say } from "./words.js";
import { speak, translate } from "../common/words.js";

const EVERY_MS = 500; // rows are for reading; they need not follow every frame
const WORST = ["none", "ok", "warn", "bad"];

// From the middle outwards, left before right, from the hip down; what is not used comes last.
const DOWN = ["chest", "pelvis", "thigh", "shank", "foot"];
const place = ({ segment }) => {
  if (!segment) return 99;
  const [part, side] = segment.split("_");
  return DOWN.indexOf(part) + ({ l: 10, r: 20 }[side] ?? 0);
};
export const inOrder = (health) => [...health].sort((a, b) => place(a) - place(b));

class LiveSensors extends HTMLElement {
  connectedCallback() {
    this.body = this.querySelector("tbody");
    this.all = this.querySelector("[data-all]");
    this.rows = new Map();
    this.drawn = -Infinity;
  }

  // health: rows of a frame; names: segment → word
  show(health, names) {
    const now = performance.now();
    if (now - this.drawn < EVERY_MS && health.length === this.rows.size) return;
    this.drawn = now;
    if ([...this.rows.keys()].join() !== health.map((h) => h.id).join()) this.build(health, names);
    for (const h of health) {
      const row = this.rows.get(h.id);
      say(row.battery, h.battery_pct === null || h.battery_pct === undefined ? "–" : `${number(h.battery_pct)}\u2009%`);
      say(row.lost, h.lost_pct === null || h.lost_pct === undefined ? "–" : `${number(h.lost_pct, h.lost_pct < 10 ? 1 : 0)}\u2009%`);
      setState(row.state, h.state, translate(h.words) || `${number(h.rate_hz)}\u2009Hz`);
    }
    const used = health.filter((h) => h.segment);
    const good = used.filter((h) => h.state === "ok").length;
    const worst = used.reduce((w, h) => (WORST.indexOf(h.state) > WORST.indexOf(w) ? h.state : w), "none");
    setState(this.all, worst, speak`${good} of ${used.length} good`);
  }

  build(health, names) {
    this.rows.clear();
    this.body.replaceChildren(...health.map((h) => {
      const tr = document.createElement("tr");
      const battery = cell("–", "n"), lost = cell("–", "n"), last = cell("", "n");
      const state = stateOf("none", "");
      last.append(state);
      tr.append(segmentCell(h.segment, names[h.segment] ?? (h.segment || h.id)), battery, lost, last);
      this.rows.set(h.id, { battery, lost, state });
      return tr;
    }));
  }
}

customElements.define("live-sensors", LiveSensors);
