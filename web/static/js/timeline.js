// <take-timeline>: strides, events and signals over one stretch of time; every change goes to the server, and
// what depends on it is drawn again from the answer.
import { showProblem } from "./common/api.js";
import { clock } from "./clock.js";
import { ticks } from "./timeline/axis.js";
import { askEvent, askReason } from "./timeline/dialogs.js";
import { h } from "./common/elements.js";
import { WORD, seconds } from "./timeline/words.js";
import { drag, follow, wheel } from "./timeline/gestures.js";
import { EventHandles } from "./timeline/handles.js";
import { SignalLane } from "./timeline/lane.js";
import { editRows, strideBox, strideRows } from "./timeline/panel.js";
import { Review } from "./timeline/review.js";
import { StrideBlocks } from "./timeline/strides.js";
import { TimeWindow } from "./timeline/window.js";
import { plural, speak, translate } from "./common/words.js";

const FIRST_SPAN_S = 6;
const FIRST_LANES = ["foot_pitch", "foot_rate", "knee_flexion"];

class TakeTimeline extends HTMLElement {
  async connectedCallback() {
    this.session = this.getAttribute("session");
    this.editable = this.hasAttribute("editable");
    this.win = new TimeWindow(clock.duration);
    this.review = new Review(this.session);
    this.asked = 0;
    this.find = (name) => this.querySelector(`[data-${name}]`);
    this.prepareStrides();
    this.prepareLanes();
    this.prepareTools();
    this.win.addEventListener("move", () => this.moved());
    clock.addEventListener("tick", () => this.ticked());
    this.review.addEventListener("change", () => this.changed());
    this.review.addEventListener("busy", () => this.setAttribute("aria-busy", String(this.review.busy)));
    await this.attempt(() => this.review.load());
    this.start();
  }

  // A link to a moment opens it: …/timeline#t=12.3; else the first counted stride.
  start() {
    const said = Number(new URLSearchParams(location.hash.slice(1)).get("t") ?? NaN);
    const at = Number.isFinite(said) ? said : (clock.stride?.start_s ?? 0);
    if (Number.isFinite(said)) clock.set(said);
    this.win.set(at - 1, at - 1 + FIRST_SPAN_S);
    this.moved();
    this.ticked();
  }

  prepareStrides() {
    const pick = (i) => this.pick(i);
    this.over = new StrideBlocks(this.find("overview"), { sides: ["left", "right"], onPick: () => {} });
    this.over.show(0, this.win.duration);
    this.brush = h("i", { class: "tl-brush", "aria-hidden": "true" });
    this.find("overview").append(this.brush);
    follow(this.find("overview"), (share) => {
      const t = share * this.win.duration;
      this.win.set(t - this.win.span / 2, t + this.win.span / 2);
    });
    const shared = {
      win: this.win, review: this.review, editable: this.editable,
      onMove: (event, to) => this.move(event, to),
      onDelete: (event) => this.remove(event),
      onPick: (event) => clock.look(event.time_s, this.strideOf(event)),
    };
    this.feet = [...this.querySelectorAll("[data-side]")].map((host) => ({
      blocks: new StrideBlocks(host, { sides: [host.dataset.side], onPick: pick }),
      handles: new EventHandles(host, host.dataset.side, shared),
    }));
    for (const host of this.querySelectorAll("[data-side]")) drag(host, this.win, () => {});
  }

  prepareLanes() {
    const known = JSON.parse(document.getElementById("lanes-data").textContent);
    this.lanes = [...this.querySelectorAll("[data-lane]")].map((host, n) => {
      const label = host.previousElementSibling;
      const lane = new SignalLane(host, label.querySelector("[data-values]"), this.session, this.win);
      const choice = label.querySelector("select");
      const wanted = known.find((l) => l.name === FIRST_LANES[n]) ?? known[Math.min(n, known.length - 1)];
      choice.value = wanted.name;
      const open = (l) => this.attempt(async () => { await lane.open(l); this.ticked(); });
      choice.addEventListener("change", () => open(known.find((l) => l.name === choice.value)));
      open(wanted);
      drag(host, this.win, (t) => clock.set(t));
      return lane;
    });
  }

  prepareTools() {
    const grid = this.find("grid");
    for (const b of this.querySelectorAll("[data-zoom]")) b.addEventListener("click", () => this.win.zoom(Number(b.dataset.zoom), this.anchor()));
    for (const b of this.querySelectorAll("[data-go]")) b.addEventListener("click", () => this.win.pan(Number(b.dataset.go) * this.win.span * 0.6));
    this.find("whole").addEventListener("click", () => this.win.whole());
    this.find("undo")?.addEventListener("click", () => this.undo());
    this.find("redo")?.addEventListener("click", () => this.redo());
    this.find("add")?.addEventListener("click", () => this.askEvent());
    grid.addEventListener("wheel", (e) => wheel(e, this.win), { passive: false });
    new ResizeObserver(() => this.moved()).observe(grid);
    document.addEventListener("keydown", (e) => this.key(e));
    this.find("figure").addEventListener("click", () => this.showFigure());
    if (remembered()) this.showFigure();
  }

  // The figure draws in this page's own thread, so it comes when asked for, and from then on each time.
  showFigure() {
    this.find("no-figure").replaceWith(document.getElementById("figure").content.cloneNode(true));
    try {
      localStorage.timelineFigure = "1";
    } catch {
      // it is asked for again next time
    }
  }

  // ---- time

  anchor() {
    return clock.t > this.win.start && clock.t < this.win.end ? clock.t : undefined;
  }

  key(e) {
    const typing = e.target.closest("input,select,textarea,dialog,[contenteditable]");
    const act = typing || !this.editable ? null : historyAct(e);
    if (act) {
      e.preventDefault();
      return this[act]();
    }
    if (e.ctrlKey || e.metaKey || e.altKey || typing) return;
    const acts = {
      "+": () => this.win.zoom(0.5, this.anchor()),
      "-": () => this.win.zoom(2, this.anchor()),
      0: () => this.win.whole(),
      ",": () => this.win.pan(-this.win.span * 0.6),
      ".": () => this.win.pan(this.win.span * 0.6),
      a: () => this.askEvent(),
      x: () => this.toggleStride(),
    };
    if (!acts[e.key]) return;
    e.preventDefault();
    acts[e.key]();
  }

  // ---- what is drawn

  moved() {
    const { win } = this;
    for (const { blocks } of this.feet) blocks.show(win.start, win.end);
    this.brush.style.left = `${(100 * win.start) / win.duration}%`;
    this.brush.style.width = `${(100 * win.span) / win.duration}%`;
    this.find("span").textContent = speak`${seconds(win.start, 1)} to ${seconds(win.end, 1)} s of ${seconds(win.duration, 1)} s`;
    this.find("axis").replaceChildren(...ticks(win, this.find("axis").clientWidth));
    this.cursor();
    clearTimeout(this.listing);
    this.listing = setTimeout(() => this.list(), 60);
  }

  cursor() {
    const at = this.win.place(clock.t);
    const line = this.find("cursor");
    line.hidden = at < 0 || at > 1;
    line.style.setProperty("--at", at);
  }

  ticked() {
    if (clock.playing && (clock.t > this.win.end || clock.t < this.win.start)) this.win.set(clock.t - 0.05 * this.win.span, clock.t + 0.95 * this.win.span);
    this.cursor();
    for (const lane of this.lanes) lane.read(clock.t);
    const now = this.review.strides.findIndex((s) => s.side === clock.stride?.side && s.start_s === clock.stride?.start_s);
    if (now === this.picked) return;
    this.picked = now;
    if (!clock.playing && now >= 0 && !this.feet.some(({ handles }) => handles.held)) this.win.reveal(this.review.strides[now].start_s, this.review.strides[now].end_s);
    this.panel();
  }

  changed() {
    const { review } = this;
    clock.load(review.strides);
    for (const blocks of [this.over, ...this.feet.map((f) => f.blocks)]) blocks.draw(review.strides);
    for (const { handles } of this.feet) handles.renew();
    for (const side of ["left", "right"]) {
      const own = review.strides.filter((s) => s.side === side);
      this.querySelector(`[data-counts=${side}]`).textContent = speak`${own.filter((s) => s.used).length} of ${own.length}`;
    }
    this.dropped = null;
    this.showHistory();
    this.find("edits").replaceChildren(...editRows(review));
    this.find("edit-count").textContent = review.edits.length ? String(review.edits.length) : "";
    this.picked = null;
    this.ticked();
    this.panel();
  }

  panel() {
    const stride = this.review.strides[this.picked] ?? null;
    for (const { blocks } of this.feet) blocks.pick(this.picked);
    const acts = {
      editable: this.editable, review: this.review,
      onMove: (event, to) => this.move(event, to),
      onDelete: (event) => this.remove(event),
      onLeaveOut: (s, reason) => (reason ? this.leaveOut(s, reason) : this.askReason(s)),
      onCount: (s) => this.count(s),
    };
    const field = this.find("stride-box").contains(document.activeElement) ? document.activeElement.id : "";
    this.find("stride-box").replaceChildren(...strideBox(stride, acts));
    if (field) document.getElementById(field)?.focus(); // the fields are new ones, the place of the keyboard is not
    document.getElementById("h-stride").textContent = stride ? stride.side === "left" ? speak`Left stride, ${seconds(stride.start_s)} s` : speak`Right stride, ${seconds(stride.start_s)} s` : speak`Stride`;
    this.find("verdict").textContent = "";
    if (stride) this.find("verdict").append(h("span", { class: `badge plain${stride.used ? " ok" : ""}` }, stride.used ? speak`included` : speak`excluded`));
    this.list();
  }

  list() {
    const { words, rows } = strideRows(this.review, this.win, this.picked, (i) => this.pick(i, true));
    this.find("listed").textContent = words;
    this.find("list").replaceChildren(...rows);
  }

  // The stride that an event begins or lies in, else the one it ends.
  strideOf({ side, time_s }) {
    const own = this.review.strides.filter((s) => s.side === side);
    return own.find((s) => s.start_s <= time_s && time_s < s.end_s) ?? own.find((s) => s.end_s === time_s) ?? clock.stride;
  }

  // ---- what a person does

  // The first click shows a stride, the second asks whether it counts.
  pick(i, only = false) {
    if (i === this.picked && !only) return this.toggleStride();
    clock.pick(clock.strides[i]);
    this.win.reveal(this.review.strides[i].start_s, this.review.strides[i].end_s);
  }

  toggleStride() {
    const stride = this.review.strides[this.picked];
    if (!stride || !this.editable) return;
    if (stride.used) this.askReason(stride);
    else this.count(stride);
  }

  askReason(stride) {
    askReason(stride, (reason) => this.leaveOut(stride, reason));
  }

  leaveOut(stride, reason) {
    return this.change({ kind: "exclude_stride", side: stride.side, time_s: middle(stride), reason }, speak`The ${translate(stride.side)} stride is excluded.`);
  }

  count(stride) {
    this.change({ kind: "include_stride", side: stride.side, time_s: middle(stride) }, speak`The ${translate(stride.side)} stride is included.`);
  }

  askEvent(side = clock.stride?.side ?? "left", time = clock.t) {
    if (!this.editable) return;
    const before = this.review.events.filter((e) => e.side === side && e.time_s < time).at(-1);
    const event = before?.kind === "ic" ? "tc" : "ic"; // the two take turns
    askEvent({ side, event, time_s: time }, (edit) => this.change({ kind: "add_event", ...edit }, speak`${WORD[edit.event]} added.`));
  }

  move(event, to) {
    return this.change({ kind: "move_event", side: event.side, event: event.kind, time_s: event.time_s, to_s: to }, speak`${translate(event.side)} ${WORD[event.kind]} moved to ${seconds(to, 3)} s.`);
  }

  remove(event) {
    this.change({ kind: "delete_event", side: event.side, event: event.kind, time_s: event.time_s }, speak`${translate(event.side)} ${WORD[event.kind]} deleted.`);
  }

  // Key presses that are not a change yet are undone, and redone, as one: the event goes back where it was.
  undo() {
    const moving = this.holding();
    if (moving) {
      this.dropped = { event: moving.held, to: moving.at };
      moving.drop(moving.held);
      this.showHistory();
    } else if (this.review.edits.length) this.done(() => this.review.undo(), speak`The last change was undone.`);
  }

  // While an event is held a new change has begun.
  redo() {
    if (this.holding()) return;
    if (this.dropped) this.move(this.dropped.event, this.dropped.to);
    else if (this.review.redoable) this.done(() => this.review.redo(), speak`The change was redone.`);
  }

  holding() {
    return this.feet.find(({ handles }) => handles.held)?.handles;
  }

  showHistory() {
    if (!this.editable) return;
    this.find("undo").disabled = !this.review.edits.length;
    this.find("redo").disabled = !this.dropped && !this.review.redoable;
  }

  change(edit, said) {
    return this.done(() => this.review.change(edit), said);
  }

  async done(act, said) {
    const began = performance.now();
    if (!(await this.attempt(act))) return this.panel(); // fields show again what holds
    await this.attempt(() => this.numbers());
    this.dataset.took = String(Math.round(performance.now() - began));
    const used = this.review.strides.filter((s) => s.used).length;
    this.find("said").textContent = plural(used, speak`${said} ${used} of ${this.review.strides.length} strides is included.`, speak`${said} ${used} of ${this.review.strides.length} strides are included.`);
  }

  // The numbers are written by the server, as on the other pages. An answer to what was asked before the last change
  // is late: another one comes.
  async numbers() {
    const asked = ++this.asked;
    document.getElementById("numbers").setAttribute("aria-busy", "true"); // until others stand there they do not hold
    const path = `/sessions/${this.session}/timeline/numbers`;
    const answer = await fetch(path, { credentials: "same-origin", headers: { "X-Sagittal-Fragment": "numbers" } }).catch(() => null);
    const text = await answer?.text().catch(() => null);
    if (asked !== this.asked) return;
    if (!answer?.ok || !text) throw { title: speak`The values could not be loaded`, detail: speak`Reload the page.` };
    const page = new DOMParser().parseFromString(text, "text/html");
    document.getElementById("numbers").replaceWith(page.getElementById("numbers"));
  }

  async attempt(act) {
    this.find("problem").hidden = true;
    try {
      await act();
      return true;
    } catch (problem) {
      showProblem(this.find("problem"), problem);
      return false;
    }
  }
}

function remembered() {
  try {
    return localStorage.timelineFigure === "1";
  } catch {
    return false;
  }
}

// Ctrl+Z; Ctrl+Shift+Z or Ctrl+Y; on a Mac with Cmd, where Cmd+Y is the browser's own.
function historyAct({ key, ctrlKey, metaKey, shiftKey, altKey }) {
  if (!(ctrlKey || metaKey) || altKey) return null;
  if (key.toLowerCase() === "z") return shiftKey ? "redo" : "undo";
  return key.toLowerCase() === "y" && ctrlKey && !shiftKey ? "redo" : null;
}

const middle = (stride) => (stride.start_s + stride.end_s) / 2;

customElements.define("take-timeline", TakeTimeline);
