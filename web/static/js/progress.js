// <job-progress job="…" done="/where"> follows one job by server-sent events: stage names, bar, cancel.
import { request, showProblem } from "./common/api.js";
import { speak, translate } from "./common/words.js";

const ENDS = new Set(["done", "failed", "cancelled"]);

const PREPARED_MS = 5000;
const TYPING = "textarea, input:not([type=checkbox], [type=radio], [type=range], [type=file])";

// Nobody loses the field or the dialog that is in use: the page waits for it.
function whenHandsAreFree(go) {
  const busy = () => document.querySelector("dialog[open]") || document.activeElement?.matches(TYPING);
  if (!busy()) return go();
  const wait = setInterval(() => {
    if (busy()) return;
    clearInterval(wait);
    go();
  }, 500);
}

class JobProgress extends HTMLElement {
  connectedCallback() {
    this.started = Date.parse(this.getAttribute("since")) || Date.now();
    this.source = new EventSource(`/api/v1/jobs/${this.getAttribute("job")}/events`);
    this.source.onmessage = (e) => this.show(JSON.parse(e.data));
    this.source.onerror = () => this.say(speak`Connection lost, trying again…`);
    this.querySelector("[data-cancel]")?.addEventListener("click", () => this.cancel());
    this.clock = setInterval(() => this.tick(), 1000);
    this.tick();
  }

  disconnectedCallback() {
    this.source?.close();
    clearInterval(this.clock);
  }

  tick() {
    const el = this.querySelector("[data-clock]");
    if (el) el.textContent = `${Math.max(0, Math.round((Date.now() - this.started) / 1000))} s`;
  }

  say(text) {
    const el = this.querySelector("[data-message]");
    if (el && el.textContent !== text) el.textContent = text;
  }

  show(job) {
    if (ENDS.has(job.state)) {
      this.source.close();
      clearInterval(this.clock);
      this.dispatchEvent(new CustomEvent("job-end", { bubbles: true, detail: job }));
      const target = this.getAttribute(job.state === "done" ? "done" : "failed") ?? this.getAttribute("done");
      if (job.state === "done") this.say(speak`Done`);
      if (target) whenHandsAreFree(() => (target === "reload" || target === location.pathname ? location.reload() : location.assign(target)));
      return;
    }
    const fraction = job.fraction ?? 0;
    const bar = this.querySelector("progress");
    if (bar) bar.value = fraction;
    const percent = this.querySelector("[data-percent]");
    if (percent) percent.textContent = `${Math.round(100 * fraction)} %`;
    const step = this.markStages(job);
    this.say(job.state === "queued" ? this.waiting() : step || translate(job.message) || speak`Working`);
  }

  // A server that has just started still loads, at its first start compiles, the filters.
  waiting() {
    const long = this.querySelector("[data-clock]") && Date.now() - this.started > PREPARED_MS;
    return long ? speak`Waiting for the worker. This takes up to a minute after a server start.` : speak`Waiting for the worker`;
  }

  // Stages before the current one are done, it runs, the rest wait; returns its name.
  markStages(job) {
    const items = [...this.querySelectorAll("[data-stage]")];
    const at = items.findIndex((li) => li.dataset.stage === job.stage);
    if (at < 0) return "";
    items.forEach((li, i) => {
      const now = i < at ? "ok" : i === at ? "run" : "none";
      if (li.dataset.now === now) return;
      li.dataset.now = now;
      li.querySelector(".state").className = `state ${now}`;
      li.querySelectorAll("[data-shape]").forEach((s) => (s.hidden = s.dataset.shape !== now));
    });
    return items[at].textContent.trim(); // how far it is the bar alone says: stages differ in length
  }

  async cancel() {
    this.say(speak`Stopping…`);
    try {
      await request("POST", `/api/v1/jobs/${this.getAttribute("job")}/cancel`);
    } catch (problem) {
      const note = this.querySelector(".form-error");
      if (note) showProblem(note, problem);
      else this.say(problem.message);
    }
  }
}
customElements.define("job-progress", JobProgress);
