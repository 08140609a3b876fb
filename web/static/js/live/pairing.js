// The take before anything streams: open it, show its code, count down, ask for a new one.
import { request, showProblem } from "../common/api.js";
import { formatClock, speak } from "../common/words.js";
import { code as grouped, say } from "./words.js";

const TAKEN = new Set(["pairing", "open"]);

export class Pairing {
  constructor(root, api) {
    this.root = root;
    this.api = api;
    this.note = root.querySelector(".form-error");
    setInterval(() => this.#tick(), 1000);
  }

  open() { return this.#ask(this.api); }
  renew() { return this.#ask(`${this.api}/code`); }

  async #ask(path) {
    this.note.hidden = true;
    try {
      this.show(await request("POST", path, {}));
    } catch (problem) {
      showProblem(this.note, problem);
    }
  }

  // The code is told once, to who asked for it: a page that is opened later asks for a new one.
  show(take) {
    const open = Boolean(take);
    this.root.querySelector("[data-nocode]").hidden = open;
    this.root.querySelector("[data-code-box]").hidden = !open;
    if (!open) return;
    if (take.code) this.#code(take.code, take.expires_at);
    else if (!this.ends) this.#code(null, null);
  }

  // What the feed says of a take that does not stream yet.
  state(state) {
    if (!TAKEN.has(state.state)) return this.show(null);
    this.show({ code: null });
    const paired = state.state === "open";
    say(this.root.querySelector("[data-waiting]"), paired ? speak`The tablet is paired. Choose the sensors there and press Start.` : speak`Waiting for the tablet`);
  }

  #code(code, expires) {
    const out = this.root.querySelector("[data-code]");
    say(out, code ? grouped(code) : "––– –––");
    if (code) out.setAttribute("aria-label", [...code].join(" "));
    const here = this.root.querySelector("[data-here]");
    here.hidden = !code;
    if (code) here.href = `/capture#${code}`;
    this.ends = expires ? Date.parse(expires) : null;
    this.#tick();
  }

  #tick() {
    const out = this.root.querySelector("[data-code-left]");
    if (this.ends === undefined || !out) return;
    if (this.ends === null) return say(out, speak`The code was shown when the recording was opened. Request a new one.`);
    const left = (this.ends - Date.now()) / 1000;
    say(out, left > 0 ? speak`Valid for ${formatClock(left)}.` : speak`The code has expired. Request a new one.`);
  }
}
