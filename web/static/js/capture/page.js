// <capture-page>: pair, place the sensors, record, hand over. States: loading, pairing, prepare, running, sending, done.
import { Sha256 } from "../common/sha256.js";
import { PROTOCOL, logParts, payload } from "../common/wire.js";
import { Camera } from "./camera.js";
import { alone, roomHours, stayAwake, tone } from "./device.js";
import { Link } from "./link.js";
import { remember } from "./mapping.js";
import { Outbox } from "./outbox.js";
import { codeForm } from "./pairing.js";
import { whyNot as whyNoMotion } from "./sources/device_motion.js";
import { whyNot as whyNoDot } from "./sources/dot.js";
import { View } from "./view.js";
import * as words from "./words.js";
import { Worn } from "./worn.js";
import { speak } from "../common/words.js";

const DRAW_MS = 500;
const TWICE_MS = 800; // a second tap on Start must not be a Stop
const BYTES_PER_S = 7 * 100 * 36; // seven sensors at 100 Hz, nine float32 each

class CapturePage extends HTMLElement {
  async connectedCallback() {
    this.$ = (name) => this.querySelector(`[data-${name}]`);
    this.$("host").textContent = location.host;
    this.worn = new Worn({
      onchange: () => this.draw(), onend: () => this.stop(), onbattery: (sensors) => this.link?.tellBattery(sensors),
    });
    this.view = new View(this, { onplaced: (sensor, segment) => this.worn.place(sensor, segment) });
    this.camera = new Camera(this);
    codeForm(this.$("code-form"), {
      onpaired: (paired) => this.guarded(() => this.paired(paired)), onproblem: ({ title, detail }) => this.say({ title, detail }),
    });
    const on = (name, act) => this.$(name).addEventListener("click", () => this.guarded(act));
    on("go", () => this.go());
    on("change", () => this.change());
    on("add", () => this.choose(this.worn.kind));
    on("other", () => this.worn.leave());
    on("end", () => this.stop());
    on("axes-again", () => this.worn.source.check());
    on("save", () => this.saveRest());
    on("give-up", () => this.giveUp());
    for (const b of this.querySelectorAll("[data-source]")) {
      b.addEventListener("click", () => this.guarded(() => this.choose(b.dataset.source)));
    }
    this.$("files").addEventListener("change", (e) => this.guarded(() => this.read([...e.target.files])));
    for (const [kind, why] of [["dot", whyNoDot()], ["device_motion", whyNoMotion()]]) if (why) this.view.unavailable(kind, why);
    this.room = await roomHours(BYTES_PER_S);
    if (!(await alone())) return this.say(words.OTHER_TAB);
    setInterval(() => this.draw(), DRAW_MS);
    await this.camera.wake();
    await this.guarded(() => this.wake());
  }

  // After a reload: whatever was not finished goes on.
  async wake() {
    try {
      this.outbox = await Outbox.unfinished();
    } catch (error) {
      return this.say(words.storageProblem(error));
    }
    if (!this.outbox) {
      this.enter("pairing");
      return this.takeOffered();
    }
    const { hello, stopped, kind, source } = this.outbox.record;
    this.watchStorage();
    if (!hello) return this.enter("prepare");
    this.connect();
    if (stopped) return this.enter("sending");
    this.enter("running");
    if (kind !== "replay") return this.interrupted(kind);
    await this.worn.read(source.files);
    if (!this.outbox || this.dataset.state === "stuck" || this.dataset.state === "done") return; // refused meanwhile
    this.worn.restore(hello);
    this.run();
  }

  // The therapist's page on this very device leads here with its code, which nobody has to type then.
  takeOffered() {
    const code = location.hash.slice(1);
    if (!code) return;
    history.replaceState(null, "", location.pathname);
    const input = this.$("code-form").querySelector("input");
    input.value = code;
    input.dispatchEvent(new Event("input"));
  }

  // A page needs a tap before it may use Bluetooth or motion again.
  interrupted(kind) {
    this.paused = true;
    this.worn.take(kind);
    this.draw();
  }

  async paired({ code, ...paired }) {
    this.say(null);
    if (this.outbox && this.outbox.record.take !== paired.take) {
      return this.say(words.OTHER_TAKE, true);
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
    this.say(null);
    await this.worn.add(kind);
    if (this.paused) this.goOn();
  }

  async read(files) {
    this.$("files").value = "";
    if (!files.length) return;
    this.say(null);
    await this.worn.read(files);
  }

  async go() {
    const { state } = this.dataset;
    if (state === "done") return this.enter("pairing");
    if (state === "running" && performance.now() - this.entered < TWICE_MS) return;
    if (state === "running") return this.paused ? this.choose(this.worn.kind) : this.stop();
    if (state === "prepare") return this.start();
  }

  async start() {
    const { source } = this.worn;
    const segments = Object.fromEntries(this.worn.ready().map((sensor) => [sensor.id, sensor.segment]));
    remember(segments);
    const hello = {
      type: "hello", protocol: PROTOCOL, take: this.outbox.record.take, source: source.kind, streams: source.streams(segments),
    };
    await this.outbox.note({ hello, kind: source.kind, source: source.saved() });
    this.say(null);
    this.connect();
    this.enter("running");
    this.run();
    tone();
    this.camera.begin(this.outbox.record);
  }

  run() {
    const { outbox } = this;
    this.paused = false;
    this.began = performance.now() - outbox.record.spanS * 1000;
    const keep = (batch, rateHz) => outbox.add({ ...batch, sentUs: (performance.timeOrigin + performance.now()) * 1000 }, rateHz);
    this.worn.source.start(keep, outbox.record.lastUs);
    this.draw();
  }

  // The sensors of an interrupted take come back one by one.
  goOn() {
    const { hello } = this.outbox.record;
    const here = new Set(this.worn.sensors.map((s) => s.id));
    if (!hello.streams.every((s) => s.sensors.every((x) => here.has(x.id)))) return;
    this.worn.restore(hello);
    this.run();
  }

  async stop() {
    if (this.dataset.state !== "running") return;
    this.worn.source?.stop();
    this.camera.end();
    this.enter("sending");
    await this.outbox.note({ stopped: true });
    this.link.pump();
    tone(660);
  }

  connect() {
    this.link?.leave();
    this.link = null; // the new one speaks before it is assigned
    this.link = new Link(this.outbox, { onchange: () => this.linked(), onmessage: (m) => this.told(m) });
  }

  linked() {
    const { state, problem } = this.link ?? {};
    if (state === "finished") return this.finished();
    if (state === "refused" && problem) this.refused(problem);
    this.draw();
  }

  told(message) {
    if (message.type === "command" && message.command === "stop") this.guarded(() => this.stop());
    if (message.type === "calibration") {
      this.verdict = message;
      return this.draw();
    }
    if (message.type !== "state" || (message.stage === this.stage && message.say === this.toDo)) return;
    if (message.stage === "walk" && this.stage !== "walk" && !message.say) tone();
    [this.stage, this.toDo] = [message.stage, message.say];
    if (this.stage !== "running") this.verdict = null;
    this.draw();
  }

  async finished() {
    this.worn.source?.stop();
    this.camera.end();
    const said = words.ending(this.outbox.made, this.link.marked);
    await this.outbox.forget();
    this.outbox = this.link = null;
    this.paused = false;
    this.$("done").textContent = said.title;
    this.$("done-more").textContent = said.more;
    this.say(null);
    this.enter("done");
  }

  refused(problem) {
    if (problem.code === "ended" && this.outbox.made === this.outbox.acked) return this.finished();
    if (problem.code === "token") {
      this.enter("pairing"); // the sensors go on into the outbox meanwhile
      return this.say(words.linkProblem(problem, this.outbox.heldS));
    }
    this.worn.source?.stop();
    this.camera.end();
    const rest = this.outbox.made > this.outbox.acked;
    this.say(words.linkProblem(problem, this.outbox.heldS), rest);
    this.enter("stuck");
    if (!rest) this.drop({ silent: true });
  }

  async saveRest() {
    const { outbox } = this;
    const batches = await outbox.all();
    const hash = new Sha256();
    for (const bytes of batches) hash.update(payload(bytes));
    const parts = logParts(outbox.record.hello, batches, hash.hex());
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(parts));
    link.download = `rest-${outbox.record.take.slice(0, 8)}.sagittal-live`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  }

  async giveUp() {
    const sure = await this.view.sure(speak`Delete what is on this tablet?`, words.loss(this.outbox.heldS), speak`Delete it`);
    if (sure) await this.drop();
  }

  async change() {
    if (this.outbox.made > this.outbox.acked) return this.giveUp();
    await this.drop();
  }

  // Let go of the take.
  async drop({ silent = false } = {}) {
    this.link?.leave();
    this.camera.end();
    await this.outbox.forget();
    this.outbox = this.link = null;
    this.paused = false;
    if (!silent) this.say(null);
    this.enter("pairing");
  }

  async guarded(act) {
    try {
      await act();
    } catch (error) {
      this.say({ title: speak`Action failed`, detail: error.message });
    }
  }

  draw() {
    if (!this.view) return;
    this.camera.draw(this.dataset.state);
    this.view.draw({
      state: this.dataset.state, problem: this.problem, paused: this.paused, stage: this.stage, toDo: this.toDo,
      verdict: this.verdict, room: this.room,
      record: this.outbox?.record, heldS: this.outbox?.heldS ?? 0, link: this.link?.words(), linkSays: this.link?.said,
      elapsedS: this.began === undefined ? 0 : (performance.now() - this.began) / 1000,
      source: this.worn.source, rows: this.worn.rows(), ready: this.worn.ready(),
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
    this.worn.remembered = this.outbox?.record.remembered ?? {};
    this.entered = performance.now();
    if (state === "running") this.stage = this.toDo = this.verdict = undefined;
    stayAwake(state === "running" || state === "sending");
    this.draw();
    if (state === "pairing") this.$("code-form").querySelector("input").focus();
  }
}

customElements.define("capture-page", CapturePage);
