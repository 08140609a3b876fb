// Event handles of one foot: drag, arrow keys, Delete. A handle is a slider whose value is a time.
import { clock } from "../clock.js";
import { SIDE_KEY, speak, translate } from "../common/words.js";
import { h, s } from "../common/elements.js";
import { WORD, seconds } from "./words.js";

const CLOSE_PX_PER_S = 44; // below it handles of one kind would lie on each other; the blocks alone are shown
const APART_S = 0.051; // the server refuses less than 50 ms between two events of a foot
const STEP_S = 0.01;
const WAIT_MS = 900;

function origin(event) {
  if (event.source === "manual") return speak`, placed manually`;
  return event.confidence === null ? "" : speak`, detected by ${Math.round(100 * event.confidence)} % of the detectors`;
}

export class EventHandles {
  constructor(host, side, { win, review, editable, onMove, onDelete, onPick }) {
    this.host = host;
    this.side = side;
    this.win = win;
    this.review = review;
    this.editable = editable;
    this.onMove = onMove;
    this.onDelete = onDelete;
    this.onPick = onPick;
    this.made = new Map();
    win.addEventListener("move", () => this.show());
  }

  // Handles of the events in view; those already there are kept, so that the focus stays.
  show() {
    const close = this.host.clientWidth / this.win.span >= CLOSE_PX_PER_S;
    const seen = close ? this.review.events.filter((e) => e.side === this.side && e.time_s >= this.win.start && e.time_s <= this.win.end) : [];
    for (const [event, handle] of this.made) {
      if (!seen.includes(event) && event !== this.held) {
        handle.remove();
        this.made.delete(event);
      }
    }
    // from the latest to the earliest, each before its successor: the order of the tab key is that of time, and a
    // handle that is there already is never moved, because that would take its focus
    let next = null;
    for (const event of seen.toReversed()) {
      if (!this.made.has(event)) {
        this.made.set(event, this.make(event));
        this.host.insertBefore(this.made.get(event), next);
      }
      next = this.made.get(event);
      this.put(event, event === this.held ? this.at : event.time_s);
    }
  }

  make(event) {
    const handle = h("div", {
      class: `ev ${event.kind} ${SIDE_KEY[this.side]}${event.source === "manual" ? " manual" : ""}`,
      role: "slider",
      tabindex: "0",
      "aria-label": `${translate(this.side)} ${WORD[event.kind]}`,
      "aria-valuemin": 0,
      "aria-valuemax": this.win.duration.toFixed(2),
      "aria-readonly": String(!this.editable),
    }, s("svg", { class: "flag", viewBox: "0 0 14 12", "aria-hidden": "true" }, s("path", { d: "M1 1h12L7 11Z" })));
    handle.addEventListener("pointerdown", (e) => this.grab(e, event, handle));
    handle.addEventListener("keydown", (e) => this.key(e, event));
    handle.addEventListener("focus", () => this.renewing || this.onPick(event));
    handle.addEventListener("blur", () => this.release(event));
    return handle;
  }

  put(event, t) {
    const handle = this.made.get(event);
    if (!handle) return;
    handle.style.left = `${100 * this.win.place(t)}%`;
    handle.setAttribute("aria-valuenow", t.toFixed(3));
    handle.setAttribute("aria-valuetext", speak`${seconds(t, 3)} seconds${origin(event)}`);
    handle.title = `${WORD[event.kind]}${origin(event)}`;
    handle.dataset.tip = `${seconds(t, 3)} s`;
  }

  // Between its neighbours of the same foot, inside the take.
  clamp(event, t) {
    const { before, after } = this.review.neighbours(event);
    const low = before ? before.time_s + APART_S : 0;
    const high = after ? after.time_s - APART_S : this.win.duration;
    return Math.min(Math.max(t, low), Math.max(high, low));
  }

  hold(event, t) {
    this.held = event;
    this.at = Math.round(1000 * this.clamp(event, t)) / 1000;
    this.made.get(event)?.classList.add("held");
    this.put(event, this.at);
    clock.look(this.at);
  }

  // The held event is where it shall stay.
  async release(event) {
    clearTimeout(this.timer);
    if (this.held !== event) return;
    this.held = null;
    this.made.get(event)?.classList.remove("held");
    if (Math.abs(this.at - event.time_s) < 0.0005) return this.put(event, event.time_s);
    this.moved = event;
    await this.onMove(event, this.at);
    if (this.review.events.includes(event)) this.put(event, event.time_s); // refused: back where it was
  }

  drop(event) {
    clearTimeout(this.timer);
    this.held = null;
    this.made.get(event)?.classList.remove("held");
    this.put(event, event.time_s);
    clock.look(event.time_s);
  }

  grab(e, event, handle) {
    if (e.button !== 0) return;
    e.preventDefault();
    e.stopPropagation();
    handle.focus();
    if (!this.editable || this.review.busy) return;
    const [from, x] = [event.time_s, e.clientX];
    const perPx = this.win.span / this.host.clientWidth;
    handle.setPointerCapture(e.pointerId);
    const move = (m) => {
      if (this.held === event || Math.abs(m.clientX - x) > 3) this.hold(event, from + (m.clientX - x) * perPx);
    };
    const end = (m) => {
      handle.removeEventListener("pointermove", move);
      for (const name of ["pointerup", "pointercancel"]) handle.removeEventListener(name, end);
      if (m.type === "pointercancel") this.drop(event);
      else this.release(event);
    };
    handle.addEventListener("pointermove", move);
    for (const name of ["pointerup", "pointercancel"]) handle.addEventListener(name, end);
  }

  key(e, event) {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
    const to = { ArrowUp: -1, ArrowDown: 1 }[e.key];
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    if (by || to || ["Delete", "Backspace", "Escape", "Enter"].includes(e.key)) {
      e.preventDefault();
      e.stopPropagation();
    }
    if (to) return this.go(event, to);
    if (!this.editable || this.review.busy) return;
    if (by) {
      this.hold(event, (this.held === event ? this.at : event.time_s) + by * STEP_S * (e.shiftKey ? 5 : 1));
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.release(event), WAIT_MS); // every press is not an edit of its own
    } else if (e.key === "Enter") this.release(event);
    else if (e.key === "Escape") this.drop(event);
    else if (e.key === "Delete" || e.key === "Backspace") {
      this.drop(event);
      this.onDelete(event);
    }
  }

  // To the next or previous event of this foot, in view or not.
  go(event, by) {
    const own = this.review.events.filter((e) => e.side === this.side);
    const next = own[own.indexOf(event) + by];
    if (!next) return;
    this.win.reveal(next.time_s);
    this.focus(next);
  }

  focus(event) {
    this.show();
    this.made.get(event)?.focus({ preventScroll: true });
  }

  // After a change the events are new objects: the handles are made again, the focus goes where it was.
  renew() {
    const focused = [...this.made].find(([, handle]) => handle === document.activeElement)?.[0];
    this.held = null;
    clearTimeout(this.timer);
    for (const handle of this.made.values()) handle.remove();
    this.made.clear();
    this.show();
    const time = focused && this.moved === focused ? this.at : focused?.time_s;
    if (focused) {
      const again = this.review.at(this.side, focused.kind, focused.time_s) ?? this.review.at(this.side, focused.kind, time);
      const nearest = this.review.events.filter((e) => e.side === this.side).sort((a, b) => Math.abs(a.time_s - time) - Math.abs(b.time_s - time))[0];
      this.renewing = true; // the cursor stays where it is: a deleted event is often put back elsewhere
      if (again ?? nearest) this.focus(again ?? nearest);
      this.renewing = false;
    }
  }
}
