// The bar on top and the one below: recording time, delay, Start, STOP, pause, the last mark.
import { STALE_MS } from "./feed.js";
import { setState } from "./shapes.js";
import { formatClock, lowered, speak, translate } from "../common/words.js";
import { number, say } from "./words.js";

// Sample to screen. Within a tenth of a second it feels at once (Card, Robertson & Mackinlay 1991, CHI: 0.1 s); from
// STALE_MS on it is stale.
const AT_ONCE_MS = 100;

export class Top {
  constructor(page) {
    this.page = page;
    this.at = (name) => page.querySelector(`[data-${name}]`);
    this.button = (name) => page.querySelector(`[data-do=${name}]`);
    setInterval(() => this.tick(), 500);
  }

  // What is trained, under the name of the visit.
  given(prescription, terms) {
    const term = terms[prescription?.parameter];
    say(this.at("given"), prescription ? ` · ${lowered(term?.label ?? prescription.parameter)}${prescription.side ? `, ${translate(prescription.side)}` : ""}` : "");
  }

  state(state) {
    const running = state.state === "streaming";
    this.now = running ? { elapsed: state.elapsed_s ?? 0, at: performance.now() } : null;
    this.at("rec").hidden = !running;
    say(this.at("rec-word"), state.stopping ? speak`Stopping… saving` : state.tablet === "connected" ? speak`Recording` : speak`On the tablet`);
    this.at("delay").hidden = !running;
    this.button("start").hidden = !(state.state === "open" && state.tablet === "connected");
    this.button("stop").hidden = !running;
    const marks = state.marks ?? [], last = marks.at(-1);
    this.button("undo").disabled = !last;
    say(this.at("last-mark"), last ? `${speak`Last mark:`} ${last.value ? `“${last.value}”, ` : ""}${formatClock(last.t_s)}` : "");
    this.tick();
  }

  delay(ms) {
    say(this.at("delay-ms"), ms === null ? "–" : `${number(ms)}\u2009ms`);
    const kind = ms === null ? "none" : ms <= AT_ONCE_MS ? "ok" : ms <= STALE_MS ? "warn" : "bad";
    setState(this.at("delay-state"), kind, { none: "", ok: speak`good`, warn: speak`slow`, bad: speak`late` }[kind]);
  }

  paused(feedback) {
    const button = this.button("pause");
    button.ariaPressed = String(Boolean(feedback.paused));
    say(this.at("pause-word"), feedback.paused ? speak`Resume feedback` : speak`Pause feedback`);
    button.querySelector("use").setAttribute("href", feedback.paused ? "#i-play" : "#i-pause");
  }

  tick() {
    if (this.now) say(this.at("elapsed"), formatClock(this.now.elapsed + (performance.now() - this.now.at) / 1000));
  }
}
