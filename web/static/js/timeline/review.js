// Events, strides and edits as the server has them; every change is the server's answer, never a guess.
import { request } from "../common/api.js";

export class Review extends EventTarget {
  constructor(session) {
    super();
    this.path = `/api/v1/sessions/${session}/edits`;
    this.events = [];
    this.strides = [];
    this.edits = [];
    this.redoable = 0;
    this.version = 0;
    this.busy = false;
  }

  async load() {
    this.take(await request("GET", this.path));
  }

  // Problems are thrown to whoever asked; nothing is changed then.
  async change(edit) {
    await this.ask("POST", edit);
  }

  async undo() {
    await this.ask("DELETE");
  }

  async redo() {
    await this.ask("POST", undefined, "/redo");
  }

  async ask(method, body, act = "") {
    if (this.busy) return;
    this.busy = true;
    this.dispatchEvent(new Event("busy"));
    try {
      this.take(await request(method, `${this.path}${act}?seen=${this.version}`, body));
    } catch (problem) {
      if (problem.code === "edited_meanwhile" || problem.code === "no_such_event") await this.load();
      throw problem;
    } finally {
      this.busy = false;
      this.dispatchEvent(new Event("busy"));
    }
  }

  take(answer) {
    Object.assign(this, { events: answer.events, strides: answer.strides, edits: answer.edits, redoable: answer.redoable, version: answer.version });
    for (const stride of this.strides) stride.used = stride.excluded_by === null;
    this.dispatchEvent(new Event("change"));
  }

  // The events of a foot before and after a moment, this one itself left out.
  neighbours(event) {
    const own = this.events.filter((e) => e.side === event.side && e !== event);
    return {
      before: own.filter((e) => e.time_s < event.time_s).at(-1) ?? null,
      after: own.find((e) => e.time_s > event.time_s) ?? null,
    };
  }

  at(side, kind, time) {
    return this.events.find((e) => e.side === side && e.kind === kind && Math.abs(e.time_s - time) < 0.001) ?? null;
  }
}
