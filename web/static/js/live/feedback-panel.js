// <live-feedback>: level, schedule, next probe, with against without feedback, side effects; all in words.
import { setState } from "./shapes.js";
import { number, say, withUnit } from "./words.js";
import { plural, speak } from "../common/words.js";

const STOPS = { max_strides: speak`The number of strides was reached.`, max_minutes: speak`The time is up.`, gps_rise: speak`Overall gait changed too much.` };
const NOT_JUDGED = { too_few_strides: speak`too few strides yet`, joint_missing: speak`not measured`, both_sides_trained: speak`both are trained`, no_limit: speak`no known limit` };

class LiveFeedback extends HTMLElement {
  // prescription: content of the record | null; term: {label, unit, digits}
  given(prescription, term) {
    this.prescription = prescription;
    this.term = term;
    this.querySelector("[data-has]").hidden = !prescription;
    this.querySelector("[data-on-line]").hidden = !prescription;
    this.querySelector("[data-none]").hidden = Boolean(prescription);
    const other = { left: speak`Right side`, right: speak`Left side` }[prescription?.side] ?? speak`Side effects`;
    say(this.querySelector("[data-guard-side]"), other);
  }

  show(state) {
    if (!this.prescription) return;
    const put = (name, text) => say(this.querySelector(`[data-${name}]`), text);
    const on = this.querySelector("input.switch");
    on.checked = state.on;
    put("on-word", state.on ? speak`On` : speak`Off`);
    put("level", number(state.level));
    put("schedule", this.schedule(state));
    put("probe", this.probe(state));
    put("with", this.summary(state.with_feedback));
    put("without", this.summary(state.without_feedback));
    this.guard(state.guard);
    const stopped = this.querySelector("[data-stopped]");
    stopped.hidden = !state.stopped;
    if (state.stopped) say(stopped, speak`Feedback has ended. ${STOPS[state.stopped] ?? ""}`);
  }

  schedule(state) {
    if (state.paused) return speak`paused`;
    if (state.phase === "baseline") return speak`first strides, without feedback`;
    if (state.phase === "retention") return speak`retention test, without feedback`;
    const kind = this.prescription.schedule?.kind;
    if (kind === "every" || state.share_pct === 100) return speak`every stride`;
    return speak`${kind === "fading" ? speak`fading, ` : ""}${number(state.share_pct)}\u2009% of strides`;
  }

  probe(state) {
    if (state.block_left) return plural(state.block_left, speak`now, 1 stride left`, speak`now, ${state.block_left} strides left`);
    if (state.next_probe === null || state.next_probe === undefined) return speak`none`;
    return plural(state.next_probe, speak`in 1 stride`, speak`in ${state.next_probe} strides`);
  }

  summary(s) {
    return s && s.n ? `${withUnit(s.mean, this.term)} (${s.n})` : "–";
  }

  guard(guard) {
    const out = this.querySelector("[data-guard]");
    if (!guard) return;
    let state = out.firstElementChild;
    if (!state) out.replaceChildren((state = document.createElement("span")));
    if (guard.other?.beyond) setState(state, "warn", speak`changed by ${withUnit(guard.other.change, this.term)}`);
    else if (guard.gps?.beyond) setState(state, "warn", speak`gait changed, sagittal score +${number(guard.gps.change, 1)}°`);
    else if (guard.state === "ok") setState(state, "ok", speak`no side effect`);
    else setState(state, "none", NOT_JUDGED[guard.other?.reason] ?? speak`not known yet`);
  }

  // How close the next level is: "In the zone more than 14 of 20: level 3 comes next."
  next(state) {
    const p = this.prescription?.progression;
    if (!p?.automatic || state.phase !== "training" || state.in_zone === null) return "";
    const needed = Math.floor(p.share * p.window + 1e-9);
    if (state.window_n < p.window) return speak`${p.window} strides are needed to adjust the level; ${state.window_n} so far.`;
    return state.level > 0 ? speak`More than ${needed} of ${p.window} in the zone: next level.` : speak`Most difficult level.`;
  }
}

customElements.define("live-feedback", LiveFeedback);
