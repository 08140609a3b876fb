// <live-page>: the therapist's screen. What the feed says goes to the parts; what is pressed goes to the server.
import "../progress.js";
import "./calibration.js";
import "./feedback-panel.js";
import "./guided.js";
import "./stride-chart.js";
import "./view.js";
import { Feed } from "./feed.js";
import { whenOther } from "./given.js";
import { Commands } from "./commands.js";
import { Pairing } from "./pairing.js";
import { Screen } from "./screen.js";
import { StripCard } from "./strip-card.js";
import { Top } from "./top.js";
import { After } from "./after.js";
import { Notes } from "./notes.js";
import { inOrder } from "./sensors.js";
import { formatClock, plural, speak } from "../common/words.js";
import { number, say } from "./words.js";

const data = JSON.parse(document.getElementById("live-data").textContent);
const OVER = new Set(["finished", "closed"]);
const SPOKEN_MS = 5000; // live values are read out at most so often

class LivePage extends HTMLElement {
  connectedCallback() {
    const api = `/api/v1/sessions/${data.session}/live`;
    const part = (name) => this.querySelector(`[data-part=${name}]`);
    this.parts = Object.fromEntries([...this.querySelectorAll("[data-part]")].map((p) => [p.dataset.part, p]));
    this.feed = new Feed(`/sessions/${data.session}/live/feed`);
    this.notes = new Notes(this.querySelector("[data-notes]"));
    this.commands = new Commands(api, (problem) => this.notes.problem(problem));
    this.pairing = new Pairing(part("pair"), api);
    this.top = new Top(this);
    this.strip = new StripCard(this.querySelector(".l-strip"), data, this.feed);
    this.ended = new After(part("over"), data.session);
    this.screen = new Screen(this, data.session);
    this.chart = this.querySelector("stride-chart");
    this.sensors = this.querySelector("live-sensors");
    this.calibration = this.querySelector("live-calibration");
    this.feedback = this.querySelector("live-feedback");
    this.figure = this.querySelector("live-view");
    this.test = this.querySelector("live-test"); // only where the session is a functional test
    this.test?.given(data.test, data.terms);
    this.given();
    this.pick("knee_flexion");
    this.listen();
    this.press();
    this.feed.open();
    setInterval(() => this.speak(), SPOKEN_MS);
  }

  given() {
    this.feedback.given(data.prescription, data.terms[data.prescription?.parameter]);
    this.strip.given();
    this.top.given(data.prescription, data.terms);
  }

  listen() {
    const on = (type, act) => this.feed.addEventListener(type, (e) => act(e.detail));
    on("state", (state) => this.state(state));
    on("frame", (frame) => this.frame(frame));
    on("stride", (stride) => { this.chart.stride(stride); this.strip.changed(); });
    on("cue", () => this.strip.changed());
    on("feedback", (state) => { this.feedback.show(state); this.top.paused(state); this.strip.state(state, this.feedback.next(state)); });
    on("notice", (notice) => {
      if (!this.test || notice.code !== "no_live_figure") this.notes.notice(notice); // a test shows no figure
    });
    on("fresh", () => this.cover());
    on("line", (line) => { this.notes.line(line); this.figure.line(line); });
  }

  // One part at a time: pairing, calibration, the walk, what came of it.
  view(name) {
    if (this.dataset.view === name) return;
    this.dataset.view = name;
    for (const [key, part] of Object.entries(this.parts)) part.hidden = key !== name;
    if (name === "calibrate" || name === "run" || name === "test") this.parts[name].querySelector("[data-slot=sensors]").append(this.sensors);
    this.querySelector("[data-bar]").hidden = name !== "run";
  }

  state(state) {
    this.stopping = this.stopping === state.take || state.stopping ? state.take : null; // pressed here, or known to the server
    this.top.state({ ...state, stopping: Boolean(this.stopping) });
    this.cover();
    if (state.ghost) this.ghost(state.ghost);
    this.notes.tablet(state);
    this.notes.estimate(state);
    if (OVER.has(state.state)) {
      this.view("over");
      this.ended.show(state, this.watched === state.take);
      return;
    }
    if (this.watched === undefined || (state.state === "streaming" && this.lastState !== "streaming")) whenOther(data, () => this.given());
    this.lastState = state.state;
    this.watched = state.take;
    if (state.state === "streaming") {
      this.view(this.streaming(this.feed.frame));
      if (!this.feed.frame) this.recorded(state);
      else if (state.estimate === "failed" && this.test?.dataset.phase !== "done") this.test?.stop();
    } else {
      this.view("pair");
      this.pairing.state(state);
    }
  }

  // The part that is shown while samples come.
  streaming(frame) {
    if (this.test) return "test";
    return frame?.stage === "running" ? "run" : "calibrate";
  }

  // Until the estimator speaks, the recorder does: which sensors send, and that the walk is kept.
  recorded(state) {
    const sensors = inOrder(state.sensors ?? []);
    this.sensors.show(sensors, data.segments);
    if (this.test) return this.test.wait(state.estimate === "preparing");
    this.calibration.show(state.estimate === "preparing" ? "preparing" : "unknown", null, sensors, data.segments);
  }

  frame(frame) {
    if (this.feed.state?.state === "streaming") this.view(this.streaming(frame));
    if (this.stage === "running" && frame.stage !== "running") this.again();
    this.stage = frame.stage;
    const health = inOrder(frame.health ?? []);
    this.sensors.show(health, data.segments);
    this.notes.calibration(frame.stage === "running" ? frame.calibration?.verdict : null);
    if (this.test) this.test.show(frame.test, frame.t);
    else if (frame.stage === "running") this.chart.frame(frame);
    else this.calibration.show(frame.stage, frame.calibration, health, data.segments);
    this.top.delay(this.feed.delay);
    this.screen.frame();
  }

  // Calibrated anew: what was drawn belongs to the old axes.
  again() {
    this.chart.clear();
    this.feed.strides.length = this.feed.cues.length = 0;
    this.strip.changed();
  }

  // Stale or stopping: both charts are covered and the figure is grey, so that nobody reads the past as now.
  cover() {
    const stale = this.feed.fresh === false || Boolean(this.stopping);
    this.querySelector("[data-cover]").hidden = !stale;
    this.figure.classList.toggle("stale", stale);
    clearInterval(this.staleClock);
    if (!stale) return;
    const words = this.querySelector("[data-cover-words]");
    say(this.querySelector("[data-cover-title]"), this.stopping ? speak`Stopping… saving` : speak`Paused: no new data`);
    const tell = () => {
      if (this.stopping) return say(words, this.feed.state?.tablet === "connected" ? speak`The tablet is sending the remaining data. This takes a moment.` : speak`The tablet is not responding. It stores its data and sends it when it reconnects.`);
      const lost = this.feed.line !== "open" ? speak`The connection to the server was lost. ` : this.feed.state?.tablet === "lost" ? speak`The tablet is not responding. ` : "";
      say(words, speak`${lost}The last data arrived ${number(this.feed.age / 1000, 1)} s ago; feedback is paused. The tablet stores its data.`);
    };
    tell();
    this.staleClock = setInterval(tell, 500);
  }

  pick(name) {
    const variable = data.variables.find((v) => v.name === name);
    for (const b of this.querySelectorAll("[data-joint]")) b.ariaPressed = String(b.dataset.joint === name);
    say(this.querySelector("[data-variable]"), variable.label);
    this.chart.show(variable);
  }

  press() {
    const acts = {
      open: () => this.pairing.open(),
      again: () => { this.view("pair"); this.pairing.open(); },
      code: () => this.pairing.renew(),
      start: () => this.commands.send("start"),
      stop: () => this.stop(),
      close: () => this.commands.close(),
      redo: () => this.commands.send("redo_calibration"),
      pause: (b) => this.commands.send("pause", b.ariaPressed !== "true"),
      feedback: (b) => this.commands.send("feedback", b.checked),
      easier: () => this.commands.send("level", 1),
      harder: () => this.commands.send("level", -1),
      mark: () => this.mark(),
      undo: () => this.commands.send("undo_mark"),
      sound: () => this.screen.sound(),
      screen: () => this.screen.open(),
      table: (b) => this.strip.table(b),
      "test-go": () => this.commands.send("test", "go"),
      "test-repeat": () => this.commands.send("test", "repeat"),
      "test-keep": () => this.keep(),
    };
    this.test?.addEventListener("submit", (e) => {
      e.preventDefault();
      const limits = this.test.typed();
      if (limits) this.commands.send("test", limits);
      else e.target.reportValidity();
    });
    this.test?.addEventListener("input", () => this.test.typed());
    this.addEventListener("click", (e) => {
      const button = e.target.closest("[data-do]");
      if (button) acts[button.dataset.do](button);
      const joint = e.target.closest("[data-joint]");
      if (joint) this.pick(joint.dataset.joint);
      const ghost = e.target.closest("[data-ghost]");
      if (ghost) {
        this.ghost(ghost.dataset.ghost);
        this.commands.send("ghost", ghost.dataset.ghost);
      }
    });
  }

  ghost(name) {
    for (const b of this.querySelectorAll("[data-ghost]")) b.ariaPressed = String(b.dataset.ghost === name);
  }

  // STOP acts at once; without the tablet the take is ended with what has arrived.
  stop() {
    if (this.feed.state?.tablet !== "connected") return this.notes.withoutTablet();
    this.stopping = this.feed.state.take;
    this.state(this.feed.state);
    this.commands.send("stop").then((done) => {
      if (done) return;
      this.stopping = null; // it was refused: the walk goes on
      this.state(this.feed.state);
    });
  }

  // The recording is measured with the start and end that are shown.
  keep() {
    const { limits } = this.test;
    if (limits) this.commands.send("test", limits);
    this.stop();
  }

  // The moment is the press, not when the words are written.
  mark() {
    const dialog = this.querySelector("#mark-dialog"), input = dialog.querySelector("input");
    const t = this.feed.frame?.t ?? null;
    say(dialog.querySelector("[data-mark-time]"), formatClock(t));
    input.value = "";
    dialog.returnValue = "";
    dialog.onclose = () => { if (dialog.returnValue === "mark") this.commands.send("mark", input.value.trim() || null, t); };
    dialog.onkeydown = (e) => { if (e.key === "Escape") dialog.close(); };
    dialog.show(); // not modal: STOP stays within reach
    input.focus();
  }

  speak() {
    if (this.dataset.view !== "run") return;
    const { delay } = this.feed;
    const words = [this.stopping ? speak`Stopping, saving` : this.feed.fresh === false ? speak`Paused, no new data` : "", this.querySelector("[data-in-zone]").textContent, delay === undefined || delay === null ? "" : plural(Math.round(delay), speak`delay 1 millisecond`, speak`delay ${Math.round(delay)} milliseconds`)];
    say(this.querySelector("[data-spoken]"), words.filter(Boolean).join(", "));
  }
}

customElements.define("live-page", LivePage);
