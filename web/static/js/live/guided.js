// <live-test>: a guided functional test. The estimator says where it stands; here it is told, and people decide.
import { cell, setState } from "./shapes.js";
import { number, say, withUnit } from "./words.js";
import { speak, translate } from "../common/words.js";

const PHASES = { get_ready: ["none", speak`Get ready`], ready: ["ok", speak`Ready`], running: ["run", speak`Running`], done: ["ok", speak`Done`] };
const DIGITS = 1; // of the running clock
const TICK_MS = 100;

class LiveTest extends HTMLElement {
  connectedCallback() {
    this.at = (name) => this.querySelector(`[data-${name}]`);
    setInterval(() => this.tick(), TICK_MS);
  }

  // test: what the page knows of the test; terms: the catalogue
  given(test, terms) {
    this.test = test;
    this.term = terms[test.total];
    say(this.at("unit"), this.term.unit);
    this.show(null, 0);
  }

  // No estimate yet, or none at all: nobody looks whether the person moves.
  wait(preparing) {
    setState(this.at("phase"), "none", preparing ? speak`Please wait` : speak`Not tracked live`);
    say(this.at("say"), preparing ? speak`Please wait and keep still. The live estimate is not ready yet.` : speak`The test is being recorded and will be analysed afterwards. Press STOP at the end.`);
  }

  // The estimate has ended in mid-test: what the clock shows is no result, and nothing here can begin it again.
  stop() {
    this.found = null;
    this.toggleAttribute("data-stopped", true);
    setState(this.at("phase"), "bad", speak`Live view stopped`);
    say(this.at("say"), speak`Continue the test. It is being recorded and will be analysed afterwards. Press STOP at the end.`);
    for (const hidden of [this.querySelector("[data-do=test-go]"), this.at("anew"), this.at("problem"), this.at("progress"), this.at("count")]) hidden.hidden = true;
  }

  // found: the test of a frame; t: its time. Frames come more often than what is judged, so the clock runs on.
  show(found, t) {
    const phase = found?.phase ?? "get_ready";
    this.toggleAttribute("data-stopped", false);
    this.found = found;
    this.now = { t, at: performance.now() };
    this.dataset.phase = phase;
    setState(this.at("phase"), ...PHASES[phase]);
    say(this.at("say"), translate(found?.say ?? this.test.say));
    this.at("problem").hidden = !found?.problem;
    say(this.at("problem"), translate(found?.problem ?? ""));
    this.at("hint").hidden = this.at("clock-line").hidden = phase === "done";
    this.at("result").hidden = phase !== "done";
    this.querySelector("[data-do=test-go]").hidden = !(this.test.go && phase === "get_ready");
    this.at("anew").hidden = phase !== "running";
    this.at("count").hidden = !this.test.rises || (phase !== "running" && phase !== "done");
    say(this.at("count"), speak`${found?.rises ?? 0} of 5`);
    this.at("progress").hidden = !found?.seconds || phase !== "running";
    if (phase === "done") this.result(found);
    else this.key = null;
    this.tick();
  }

  // The time since the test began, until it ended; stale samples do not move it on by more than half a second.
  get elapsed() {
    const { found } = this;
    if (found?.start_s === null || found?.start_s === undefined) return 0;
    const on = Math.min(0.5, (performance.now() - this.now.at) / 1000);
    return Math.max(0, (found.end_s ?? this.now.t + on) - found.start_s);
  }

  tick() {
    if (this.hasAttribute("data-stopped")) return;
    const { elapsed, found } = this;
    say(this.at("clock"), number(found?.seconds ? Math.min(elapsed, found.seconds) : elapsed, DIGITS));
    if (found?.seconds) this.at("progress").value = Math.min(1, elapsed / found.seconds);
  }

  result(found) {
    const key = JSON.stringify([found.figures, found.segments]);
    if (key === this.key) return;
    if (this.key === null) for (const d of this.querySelectorAll("details")) d.open = false;
    this.key = key;
    const total = found.figures.find((f) => f.name === this.test.total);
    const known = total?.value !== null && total?.value !== undefined;
    say(this.at("total"), known ? number(total.value, this.term.digits) : "–");
    say(this.at("total-note"), [known ? "" : translate(total?.reason), known && total.plus_minus ? `± ${withUnit(total.plus_minus, this.term)}` : "", found.corrected ? speak`start or end set manually` : ""].filter(Boolean).join(", "));
    this.at("segments-box").hidden = !found.segments.length;
    this.at("segments").replaceChildren(...found.segments.map((s) => {
      const tr = document.createElement("tr");
      tr.append(cell(translate(s.label)), cell(number(s.start_s, 2), "n"), cell(number(s.duration_s, 2), "n"));
      return tr;
    }));
    const [start, end] = this.querySelectorAll("input");
    if (this.contains(document.activeElement) && document.activeElement.tagName === "INPUT") return; // being typed
    start.value = found.start_s === null ? "" : found.start_s.toFixed(2);
    end.value = found.end_s === null ? "" : found.end_s.toFixed(2);
  }

  // What was typed, or null where the end is not after the start.
  typed() {
    const [start, end] = [...this.querySelectorAll("input")].map((i) => i.valueAsNumber);
    const fine = end > start;
    this.querySelector("#test-end").setCustomValidity(fine ? "" : speak`The end must be after the start.`);
    return fine ? { start_s: start, end_s: end } : null;
  }

  // Start and end of the trial as they are shown, null where the test was not found.
  get limits() {
    const { start_s, end_s } = this.found ?? {};
    return start_s === null || end_s === null || start_s === undefined || end_s === undefined ? null : { start_s, end_s };
  }
}

customElements.define("live-test", LiveTest);
