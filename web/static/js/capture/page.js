// <capture-page>: pair, place the sensors, record, hand over. States: loading, pairing, prepare, running, sending, done.
import { PROTOCOL, logParts } from "../live/wire.js";
import { alone, roomHours, stayAwake, tone } from "./device.js";
import { Link } from "./link.js";
import { remember, suggest } from "./mapping.js";
import { Outbox } from "./outbox.js";
import { codeForm } from "./pairing.js";
import { DeviceMotion, whyNot as whyNoMotion } from "./sources/device_motion.js";
import { Dot, whyNot as whyNoDot } from "./sources/dot.js";
import { Replay } from "./sources/replay.js";
import { View } from "./view.js";
import * as words from "./words.js";

const DRAW_MS = 500;
const SOURCES = { dot: Dot, device_motion: DeviceMotion, replay: Replay };
const BYTES_PER_SAMPLE = 36;

class CapturePage extends HTMLElement {
  async connectedCallback() {
    this.$ = (name) => this.querySelector(`[data-${name}]`);
    this.$("host").textContent = location.host;
    this.view = new View(this, { onplaced: (sensor, segment) => this.place(sensor, segment) });
    codeForm(this.$("code-form"), { onpaired: (paired) => this.paired(paired), onproblem: (p) => this.say({ title: p.title, detail: p.detail }) });
    const on = (name, act) => this.$(name).addEventListener("click", () => this.guarded(act));
    on("go", () => this.go());
    on("change", () => this.change());
    on("add", () => this.add());
    on("other", () => this.leaveSource());
    on("end", () => this.stop());
    on("axes-again", () => this.source.check());
    on("save", () => this.saveRest());
    on("give-up", () => this.giveUp());
    for (const b of this.querySelectorAll("[data-source]")) b.addEventListener("click", () => this.guarded(() => this.choose(b.dataset.source)));
    this.$("files").addEventListener("change", (e) => this.guarded(() => this.read([...e.target.files])));
    for (const [kind, why] of [["dot", whyNoDot()], ["device_motion", whyNoMotion()]]) if (why) this.view.unavailable(kind, why);
    this.room = await roomHours(7 * 100 * BYTES_PER_SAMPLE);
    if (!(await alone())) return this.say({ title: "This page is open in another tab", detail: "Go on there, or close it and reload this one." });
    setInterval(() => this.draw(), DRAW_MS);
    await this.guarded(() => this.wake());
  }

  // After a reload: whatever was not finished goes on.
  async wake() {
    this.outbox = await Outbox.unfinished();
    if (!this.outbox) return this.enter("pairing");
    const { hello, stopped, kind, source } = this.outbox.record;
    this.watchStorage();
    if (!hello) return this.enter("prepare");
    this.connect();
    if (stopped) return this.enter("sending");
    this.enter("running");
    if (kind !== "replay") return this.interrupted(kind);
    this.source = this.made("replay");
    await this.source.choose(source.files);
    this.restore(hello);
    this.run();
  }

  made(kind) {
    return new SOURCES[kind]({ onchange: () => this.changed(), onend: () => this.stop(), onbattery: (sensors) => this.link?.tellBattery(sensors) });
  }

  // A page needs a tap before it may use Bluetooth or motion again.
  interrupted(kind) {
    this.paused = true;
    this.source = this.made(kind);
    this.say({ title: "This page was loaded again", detail: "Everything up to then is safe. Connect the sensors again and go on, or stop here." });
  }

  // Sensors, order and rates as the hello has them: the server takes no other.
  restore(hello) {
    const all = hello.streams.flatMap((s) => s.sensors.map((x) => ({ ...x, rateHz: s.rate_hz })));
    const place = (sensor) => (all.findIndex((x) => x.id === sensor.id) + all.length + 1) % (all.length + 1);
    if (this.source.kind !== "replay") this.source.sensors.sort((a, b) => place(a) - place(b));
    for (const sensor of this.source.sensors) {
      const known = all.find((x) => x.id === sensor.id);
      sensor.segment = known?.segment ?? null;
      if (known && this.source.kind !== "replay") sensor.rateHz = known.rateHz;
    }
    const streams = this.source.streams(Object.fromEntries(all.map((x) => [x.id, x.segment])));
    if (JSON.stringify(streams) !== JSON.stringify(hello.streams)) throw new Error("These are not the sensors this recording began with. Connect the same ones, or stop here.");
  }

  async paired({ code, ...paired }) {
    this.say(null);
    if (this.outbox && this.outbox.record.take !== paired.take) {
      return this.say({ title: "This code belongs to another recording", detail: "Part of the earlier one is still on this tablet only. Save or delete it first." }, true);
    }
    if (this.outbox) {
      await this.outbox.note({ ...paired, code });
      this.connect();
      return this.enter(this.outbox.record.stopped ? "sending" : "running");
    }
    this.outbox = await Outbox.begin({ ...paired, code });
    this.watchStorage();
    this.enter("prepare");
  }

  watchStorage() {
    this.outbox.onproblem = (error) => this.say(error && words.storageProblem(error));
  }

  async choose(kind) {
    if (kind === "replay") return this.$("files").click();
    this.source = this.made(kind);
    await this.add();
  }

  async add() {
    if (this.source?.kind === "replay") return this.$("files").click();
    try {
      await this.source.add();
    } finally {
      if (!this.source.sensors.length && !this.paused) this.source = null;
      this.changed();
    }
    if (this.paused) this.goOn();
  }

  async read(files) {
    this.$("files").value = "";
    if (!files.length) return;
    const source = this.source ?? this.made("replay");
    await source.choose(files);
    this.source = source;
    this.changed();
  }

  async leaveSource() {
    await this.source.close();
    this.source = null;
    this.say(null);
    this.changed();
  }

  changed() {
    if (this.source) suggest(this.source.sensors);
    this.draw();
  }

  // A segment carries one sensor: it leaves the one that had it.
  place(sensor, segment) {
    for (const other of this.source.sensors) if (segment && other.segment === segment) other.segment = null;
    sensor.segment = segment;
    this.draw();
  }

  rows() {
    return (this.source?.sensors ?? []).map((sensor) => ({ sensor, health: this.source.health(sensor) }));
  }

  ready() { return this.rows().filter(({ sensor, health }) => sensor.segment && (health.kind === "ok" || (health.kind === "warn" && health.text !== "Check"))); }

  async go() {
    const { state } = this.dataset;
    if (state === "done") return this.enter("pairing");
    if (state === "running") return this.paused ? this.add() : this.stop();
    if (state === "prepare") return this.start();
  }

  async start() {
    const segments = Object.fromEntries(this.ready().map(({ sensor }) => [sensor.id, sensor.segment]));
    const { take } = this.outbox.record;
    remember(segments);
    const hello = { type: "hello", protocol: PROTOCOL, take, source: this.source.kind, streams: this.source.streams(segments) };
    await this.outbox.note({ hello, kind: this.source.kind, source: this.source.saved() });
    this.say(null);
    this.connect();
    this.enter("running");
    this.run();
    tone();
  }

  run() {
    this.paused = false;
    this.began = performance.now() - this.outbox.record.spanS * 1000;
    const { outbox } = this;
    this.source.start((batch, rateHz) => outbox.add({ ...batch, sentUs: (performance.timeOrigin + performance.now()) * 1000 }, rateHz), outbox.record.lastUs);
    this.draw();
  }

  // The sensors of an interrupted take, as they come back.
  goOn() {
    const { hello } = this.outbox.record;
    const here = new Set(this.source.sensors.map((s) => s.id));
    if (!hello.streams.every((s) => s.sensors.every((x) => here.has(x.id)))) return;
    this.restore(hello);
    this.say(null);
    this.run();
  }

  async stop() {
    this.source?.stop();
    this.enter("sending");
    await this.outbox.note({ stopped: true });
    this.link.pump();
    tone(660);
  }

  connect() {
    this.link?.end("refused");
    this.link = new Link(this.outbox, { onchange: () => this.linked(), onmessage: (m) => this.told(m) });
  }

  linked() {
    const { state, problem } = this.link ?? {};
    if (state === "finished") return this.finished();
    if (state === "refused" && problem) this.refused(problem);
    this.draw();
  }

  told(message) {
    if (message.type === "command" && message.command === "stop" && this.dataset.state === "running") this.stop();
    if (message.type !== "state" || message.stage === this.stage) return;
    this.stage = message.stage;
    if (this.stage === "walk") tone();
    this.draw();
  }

  async finished() {
    this.source?.stop();
    const { seq } = this.outbox.record;
    await this.outbox.forget();
    this.outbox = this.link = null;
    this.$("done").textContent = seq ? "Recording is on the server" : "Nothing was recorded";
    this.$("done-more").textContent = seq ? "It is being analysed; the result is on the session's page. Another recording needs a new code." : "No sensor had sent anything. Another recording needs a new code.";
    this.say(null);
    this.enter("done");
  }

  refused(problem) {
    if (problem.code === "ended" && this.outbox.made === this.outbox.acked) return this.finished();
    if (problem.code === "token") {
      this.enter("pairing"); // the sensors go on into the outbox meanwhile
      return this.say(words.linkProblem(problem, this.outbox.heldS));
    }
    this.source?.stop();
    const rest = this.outbox.made > this.outbox.acked;
    this.say(words.linkProblem(problem, this.outbox.heldS), rest);
    if (!rest) this.outbox.forget().then(() => { this.outbox = this.link = null; this.enter("pairing"); });
  }

  async saveRest() {
    const { outbox } = this;
    const parts = logParts(outbox.record.hello, await outbox.read(outbox.acked, outbox.made));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(parts));
    link.download = `rest-${outbox.record.take.slice(0, 8)}.sagittal-live`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  }

  async giveUp() {
    if (!(await this.sure("Delete what is on this tablet?", `${this.outbox.heldS.toFixed(1)} s of the recording are not on the server and cannot be brought back.`, "Delete it"))) return;
    await this.drop();
  }

  async change() {
    if (this.outbox.made > this.outbox.acked) return this.giveUp();
    await this.drop();
  }

  async drop() {
    this.link?.end("refused");
    await this.outbox.forget();
    this.outbox = this.link = null;
    this.say(null);
    this.enter("pairing");
  }

  sure(title, text, yes) {
    const dialog = this.$("sure");
    this.$("sure-title").textContent = title;
    this.$("sure-text").textContent = text;
    this.$("sure-yes").textContent = yes;
    dialog.returnValue = "";
    dialog.showModal();
    return new Promise((ok) => dialog.addEventListener("close", () => ok(dialog.returnValue === "yes"), { once: true }));
  }

  async guarded(act) {
    try {
      await act();
    } catch (error) {
      this.say({ title: "That did not work", detail: error.message });
    }
  }

  draw() {
    if (!this.view) return;
    this.view.draw({
      state: this.dataset.state, problem: this.problem, paused: this.paused, stage: this.stage, room: this.room,
      record: this.outbox?.record, heldS: this.outbox?.heldS ?? 0, link: this.link?.words(), linkSays: this.link?.said,
      elapsedS: this.began === undefined ? 0 : (performance.now() - this.began) / 1000,
      source: this.source, rows: this.rows(), ready: this.ready(),
    });
  }

  // The one sentence of the page; `rest` = there is something to save or delete.
  say(problem, rest = false) {
    this.problem = problem;
    this.$("rest").hidden = !rest;
    this.draw();
  }

  enter(state) {
    this.dataset.state = state;
    if (state === "running") this.stage = undefined;
    stayAwake(state === "running" || state === "sending");
    this.draw();
    if (state === "pairing") this.$("code-form").querySelector("input").focus();
  }
}

customElements.define("capture-page", CapturePage);
