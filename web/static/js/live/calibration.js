// <live-calibration>: stand, then walk; what is waited for, how still each sensor is, what its axes came out as.
import { cell, segmentCell, setState, shape, stateOf } from "./shapes.js";
import { STAND_S } from "../common/standing.js";
import { capitalise, speak, translate } from "../common/words.js";
import { number, say } from "./words.js";

const STEPS = 8; // straight steps, or
const WALK_S = 12; // seconds of walking

const SAYS = {
  preparing: speak`The walk is being recorded. Please stand still until the live estimate is ready.`,
  unknown: speak`The walk is being recorded, without a live estimate.`,
  waiting: speak`Waiting until every sensor sends data.`,
  stand: speak`Please stand still, feet as in walking, and look ahead.`,
  walk: speak`Now walk straight ahead at a comfortable pace.`,
};

const BEFORE = new Set(["preparing", "unknown", "waiting"]); // nobody has looked at how the person stands

class LiveCalibration extends HTMLElement {
  connectedCallback() {
    this.body = this.querySelector("tbody");
    this.rows = new Map();
  }

  show(stage, view, health, names) {
    const problem = view?.problem ?? null;
    say(this.querySelector("[data-say]"), SAYS[stage] ?? speak`Calibrated.`);
    const stood = view?.stood_s ?? 0, walked = view?.walked_s ?? 0, steps = view?.steps ?? 0;
    this.step("stand", stage === "stand" ? "run" : BEFORE.has(stage) ? "none" : "ok", Math.min(1, stood / STAND_S),
      stage === "stand" ? speak`${number(Math.min(stood, STAND_S), 1)} of ${STAND_S} seconds` : speak`${STAND_S} seconds, feet as in walking`);
    this.step("walk", stage === "walk" ? "run" : "none", Math.max(Math.min(1, steps / STEPS), Math.min(1, walked / WALK_S)),
      stage === "walk" ? speak`${steps} of ${STEPS} steps, ${number(walked)} s` : speak`${STEPS} steps`);
    const checks = new Map((view?.checks ?? []).map((c) => [c.segment, c]));
    const used = health.filter((h) => h.segment);
    if ([...this.rows.keys()].join() !== used.map((h) => h.id).join()) this.build(used, names);
    for (const h of used) this.row(h, checks.get(h.segment));
    this.notes(problem, [...checks.values()].flatMap((c) => (c.notices ?? []).map((n) => ({ ...n, of: names[c.segment] }))));
  }

  step(name, kind, fraction, words) {
    const item = this.querySelector(`[data-step=${name}]`);
    setState(item.querySelector("[data-state]"), kind, "");
    item.querySelector("progress").value = kind === "ok" ? 1 : fraction;
    say(item.querySelector("[data-words]"), words);
  }

  build(health, names) {
    this.rows.clear();
    this.body.replaceChildren(...health.map((h) => {
      const tr = document.createElement("tr");
      const now = stateOf("none", ""), axes = stateOf("none", speak`not yet`);
      const [a, b] = [cell(""), cell("")];
      a.append(now);
      b.append(axes);
      tr.append(segmentCell(h.segment, names[h.segment] ?? h.segment), a, b);
      this.rows.set(h.id, { now, axes });
      return tr;
    }));
  }

  row(h, check) {
    const { now, axes } = this.rows.get(h.id);
    const still = check?.still ?? h.still;
    if (h.state === "bad") setState(now, "bad", translate(h.words) || speak`no data`);
    else if (still === undefined || still === null) setState(now, "none", "–");
    else setState(now, still ? "ok" : "run", still ? speak`still` : speak`moving`);
    if (check?.score === null || check?.score === undefined) setState(axes, "none", speak`not yet`);
    else {
      const troubled = (check.notices ?? []).some((n) => n.severity === "bad" || n.severity === "warn");
      setState(axes, troubled ? "warn" : "ok", `${Math.round(100 * check.score)}\u2009%`);
    }
  }

  notes(problem, notices) {
    const wanted = [...(problem ? [{ severity: "warn", message: problem.message, title: speak`Calibration restarts` }] : []), ...notices];
    const box = this.querySelector("[data-cal-notes]");
    const key = JSON.stringify(wanted);
    if (box.dataset.key === key) return;
    box.dataset.key = key;
    box.replaceChildren(...wanted.map((n) => {
      const note = document.createElement("div");
      note.className = `note ${n.severity === "bad" ? "bad" : n.severity === "info" ? "" : "warn"}`;
      const title = document.createElement("b");
      title.textContent = translate(n.title ?? n.of ?? "");
      const text = document.createElement("p");
      text.textContent = capitalise(translate(n.message ?? n.text ?? ""));
      note.append(shape(n.severity === "bad" ? "bad" : "warn"), title, text);
      return note;
    }));
  }
}

customElements.define("live-calibration", LiveCalibration);
