// The line of notes under the head: the tablet is lost, the server is lost, something was refused, the take was told of.
import { h } from "../common/elements.js";
import { shape } from "./shapes.js";
import { speak, translate } from "../common/words.js";

const NOTICE_MS = 12000;
const REDO_MS = 45000;
const PREPARED_MS = 3000;

export class Notes {
  constructor(box) {
    this.box = box;
    this.shown = new Map();
  }

  put(key, kind, title, text, action) {
    const same = this.shown.get(key);
    if (same?.dataset.said === title + text) return same;
    this.take(key);
    const button = action && h("button", { class: "btn sm", type: "button", "data-do": action.do }, action.word);
    const note = h(
      "div",
      { class: `note ${kind}`, "data-said": title + text, "data-note": key },
      shape(kind === "" ? "none" : kind),
      h("b", {}, title),
      h("p", {}, text),
      action ? h("span", { class: "acts" }, button) : null,
    );
    this.shown.set(key, note);
    this.box.append(note);
    return note;
  }

  take(key) {
    this.shown.get(key)?.remove();
    this.shown.delete(key);
  }

  tablet(state) {
    if (state.problem === "node_away" && state.state !== "closed")
      this.put("tablet", "bad", speak`The server of this recording is unavailable.`, speak`The tablet continues recording and stored data is safe. This page resumes when the server is back.`, { do: "close", word: speak`End without the tablet` });
    else if (state.state === "streaming" && state.tablet !== "connected")
      this.put("tablet", "warn", speak`The tablet is not connected.`, speak`It continues recording and stores everything; missing data is sent when it reconnects. Nothing is lost.`, { do: "close", word: speak`End without the tablet` });
    else this.take("tablet");
  }

  // A server that has just started still loads, at its first start compiles, the filters.
  estimate(state) {
    if (state.state === "streaming" && state.estimate === "failed")
      return this.put("estimate", "bad", "The live view has stopped.", "The walk is recorded all the same. Its result comes after the analysis.");
    const waits = state.state === "streaming" && state.estimate === "preparing";
    this.waitsSince = waits ? this.waitsSince ?? performance.now() : undefined;
    if (waits && performance.now() - this.waitsSince > PREPARED_MS)
      this.put("estimate", "warn", speak`The live estimate is still starting.`, speak`This takes up to a minute after a server start. The walk is recorded meanwhile and the estimate catches up.`);
    else this.take("estimate");
  }

  // STOP without a tablet: the person decides, because what the tablet still holds would stay there.
  withoutTablet() {
    this.put("tablet", "warn", speak`STOP cannot reach the tablet at the moment.`, speak`Press STOP on the tablet, or end here with the data received so far; the rest stays on the tablet.`, { do: "close", word: speak`End without the tablet` });
  }

  line(line) {
    if (line === "lost") this.put("line", "bad", speak`No connection to the server.`, speak`The tablet continues recording. This page reconnects automatically.`);
    else if (line === "hidden") this.put("line", "bad", speak`You no longer have access to this patient.`, speak`Recording continues.`);
    else if (line === "refused") this.put("line", "bad", speak`You are signed out.`, speak`Sign in again to see the walk; recording continues.`);
    else this.take("line");
  }

  problem(problem) {
    const note = this.put("problem", "bad", translate(problem.title) || speak`Action failed`, translate(problem.detail));
    setTimeout(() => this.shown.get("problem") === note && this.take("problem"), NOTICE_MS);
  }

  // Pass is said for a while, redo for longer.
  calibration(verdict) {
    const said = verdict ? JSON.stringify(verdict) : "";
    if (said === this.judged) return;
    this.judged = said;
    this.take("calibration");
    if (!verdict || verdict.verdict === "not_judged") return;
    const [first] = verdict.redo;
    const text = first ? `${translate(first.title)}: ${translate(first.why)} ${translate(first.todo)}` : "";
    const redo = first ? { do: "redo", word: speak`Redo` } : undefined;
    const note = this.put("calibration", first ? "bad" : "ok", translate(verdict.headline), text, redo);
    setTimeout(() => this.shown.get("calibration") === note && this.take("calibration"), first ? REDO_MS : NOTICE_MS);
  }

  notice({ severity, text, code, sensor }) {
    const key = `notice:${code ?? text}:${sensor ?? ""}`;
    const note = this.put(key, severity === "bad" ? "bad" : severity === "warn" ? "warn" : "", "", translate(text));
    setTimeout(() => this.shown.get(key) === note && this.take(key), NOTICE_MS);
  }
}
