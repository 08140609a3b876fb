// <patient-screen>: one target, one picture, no numbers. It says what to do, sounds, and pauses when data are old.
import { Feed } from "./feed.js";
import { whenOther } from "./given.js";
import { Bar } from "./patient-bar.js";
import { Path } from "./patient-path.js";
import { HELD, ends, wayTo, what } from "./patient-words.js";
import { Sound } from "./sound.js";
import { say } from "./words.js";
import { speak, translate } from "../common/words.js";

const data = JSON.parse(document.getElementById("live-data").textContent);
const LAST = 8;
const KIND = { in: "in", near_low: "near", near_high: "near", low: "away", high: "away" };
const KEY = "sagittal.patient-screen";
const ALIVE_MS = 1000;
// What of a drawing a screen held upright shows: the bar without the room at its left, the road's nearer part.
const UPRIGHT = { bar: "330 0 560 480", path: "232 0 636 560" };

class PatientScreen extends HTMLElement {
  connectedCallback() {
    this.sound = new Sound();
    this.contacts = { l: null, r: null };
    this.picture();
    this.settings();
    const upright = matchMedia("(orientation: portrait)");
    upright.addEventListener("change", () => this.turn(upright.matches));
    this.turn(upright.matches);
    this.channel = new BroadcastChannel(`sagittal.live.${data.session}`);
    this.channel.onmessage = (e) => this.told(e.data);
    setInterval(() => this.tell(), ALIVE_MS);
    this.feed = new Feed(`/sessions/${data.session}/live/feed`);
    const on = (type, act) => this.feed.addEventListener(type, (e) => act(e.detail));
    on("frame", (frame) => this.frame(frame));
    on("cue", (cue) => this.cue(cue));
    on("state", (state) => {
      if (state.state === "streaming" && this.lastState !== "streaming") whenOther(data, () => this.anew());
      this.lastState = state.state;
    });
    for (const type of ["state", "feedback", "fresh", "line"]) on(type, () => this.hold());
    this.feed.open();
    this.hold();
  }

  // Another prescription: what was said of the one before goes.
  anew() {
    this.picture();
    this.message("", "");
    this.querySelector("[data-last]").replaceChildren();
  }

  turn(upright) {
    for (const scene of this.querySelectorAll("[data-scene]")) {
      scene.dataset.wide ??= scene.getAttribute("viewBox");
      scene.setAttribute("viewBox", upright ? UPRIGHT[scene.dataset.scene] : scene.dataset.wide);
    }
  }

  picture() {
    this.given = data.prescription;
    this.term = data.terms[this.given?.parameter];
    this.modes = new Set(this.given?.modes ?? []);
    for (const scene of this.querySelectorAll("[data-scene]")) scene.setAttribute("hidden", "");
    this.scene = null;
    if (!this.given) return;
    const { side } = this.given, isLength = this.term?.is_length ?? false;
    const name = this.modes.has("zone") && isLength ? "path" : "bar";
    this.dataset.picture = name;
    const scene = this.querySelector(`[data-scene=${name}]`);
    scene.removeAttribute("hidden");
    this.titles = scene.querySelector("[data-title]");
    const options = { side, lengths: isLength, words: ends(this.term) };
    this.scene = name === "path" ? new Path(scene, options, this) : new Bar(scene, options);
    this.scene.dim();
    say(this.querySelector("[data-what]"), what(this.given, this.term));
    const foot = this.querySelector("[data-foot]");
    foot.toggleAttribute("hidden", !side);
    if (side) foot.firstElementChild.setAttribute("class", side === "right" ? "r" : "l");
    if (side === "right") foot.firstElementChild.setAttribute("transform", "scale(-1 1)");
  }

  // What stands in the way of the picture, most important first; null = the picture is live.
  held() {
    const state = this.feed.state?.state, frame = this.feed.frame, feedback = this.feed.feedback;
    if (state === "finished" || state === "closed") return "over";
    if (state !== "streaming" || !frame) return "unopened";
    if (this.feed.fresh === false) return "stale";
    if (frame.test) return "test";
    if (frame.stage !== "running") return frame.stage;
    if (feedback?.paused) return "paused";
    if (!this.given) return "none";
    if (feedback?.stopped) return "stopped";
    return null;
  }

  hold() {
    const why = this.held();
    this.dataset.held = why ?? "";
    const box = this.querySelector("[data-pause]");
    box.hidden = why === null;
    if (why !== null) {
      const [title, words] = why === "test" ? [translate(this.feed.frame.test.say), ""] : HELD[why];
      say(box.querySelector("[data-pause-title]"), title);
      say(box.querySelector("[data-pause-words]"), words);
    } else if (this.feed.feedback?.on === false) this.alone();
  }

  frame(frame) {
    this.hold();
    for (const s of ["l", "r"]) {
      const now = Boolean(frame.contact?.[s]);
      const landed = this.contacts[s] === false && now;
      this.contacts[s] = now;
      if (landed && this.dataset.held === "" && this.modes.has("tick") && this.feed.feedback?.on !== false) this.sound.tick(s === "l" ? "left" : "right");
    }
  }

  cue(cue) {
    if (!this.scene || this.held() !== null) return;
    if (this.told_n === cue.n) return; // told again after the line came back
    this.told_n = cue.n;
    if (!cue.shown || cue.late) return this.alone(); // about a step long past nothing is said
    const kind = KIND[cue.zone];
    delete this.dataset.faded;
    this.scene.show(this.error(cue), kind);
    this.message(kind, wayTo(cue.zone, this.term));
    const marks = this.querySelector("[data-last]");
    marks.append(this.querySelector(`template[data-mark=${kind}]`).content.cloneNode(true));
    while (marks.children.length > LAST) marks.firstElementChild.remove();
    if (cue.tone) this.sound.tone(cue.tone);
  }

  // How far from the middle of the zone, in halves of it.
  error(cue) {
    const half = (cue.zone_high - cue.zone_low) / 2;
    return half > 0 ? (cue.value - (cue.zone_high + cue.zone_low) / 2) / half : 0;
  }

  // A stride without feedback: everything but the road is dim.
  alone() {
    this.dataset.faded = "";
    this.scene?.dim();
    this.message("", speak`On your own`);
  }

  message(kind, words) {
    this.querySelector("[data-sign]").setAttribute("class", `ps-sign ${kind}`);
    say(this.querySelector("[data-message]"), words);
    if (this.titles) say(this.titles, words);
  }

  // Sound needs a tap, so the screen asks once; side of the picture and volume are kept on this device.
  settings() {
    const dialog = this.querySelector("[data-start]"), volume = dialog.querySelector("[data-volume]");
    const kept = read();
    const side = (name) => {
      this.dataset.side = name;
      for (const b of dialog.querySelectorAll("[data-side]")) b.ariaPressed = String(b.dataset.side === name);
    };
    side(kept.side ?? "middle");
    volume.value = this.sound.volume = kept.volume ?? 0.5;
    dialog.addEventListener("click", async (e) => {
      const button = e.target.closest("button");
      if (button?.dataset.side) side(button.dataset.side);
      if (button?.dataset.go) {
        if (button.dataset.go === "sound") await this.sound.start();
        else this.sound.stop();
        dialog.close();
      }
      write({ side: this.dataset.side, volume: Number(volume.value) });
      this.tell();
    });
    volume.addEventListener("input", () => { this.sound.volume = Number(volume.value); });
    volume.addEventListener("change", () => this.sound.on && this.sound.tick("left"));
    this.querySelector("[data-settings]").addEventListener("click", () => dialog.showModal());
    dialog.showModal();
  }

  tell() {
    this.querySelector("[data-settings] use").setAttribute("href", this.sound.on ? "#i-sound" : "#i-mute");
    this.channel.postMessage({ sound: this.sound.on });
  }

  // The therapist's page switches the sound; a browser allows it only after this screen was tapped once.
  async told(message) {
    if (message.set?.sound === true) await this.sound.start();
    if (message.set?.sound === false) this.sound.stop();
    this.tell();
  }
}

function read() {
  try { return JSON.parse(localStorage.getItem(KEY)) ?? {}; } catch { return {}; }
}

function write(kept) {
  try { localStorage.setItem(KEY, JSON.stringify(kept)); } catch { /* storage refused: asked again next time */ }
}

customElements.define("patient-screen", PatientScreen);
