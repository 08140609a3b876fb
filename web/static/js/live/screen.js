// The patient's screen seen from here: opens its window and switches its sound. The two windows of one browser speak
// over a channel; a patient screen on another device has its own switch.
import { speak } from "../common/words.js";
const ALIVE_MS = 4000;

export class Screen {
  constructor(page, session) {
    this.path = `/sessions/${session}/live/patient`;
    this.button = page.querySelector("[data-do=sound]");
    this.word = page.querySelector("[data-sound-word]");
    this.channel = new BroadcastChannel(`sagittal.live.${session}`);
    this.channel.onmessage = (e) => this.heard(e.data);
    this.channel.postMessage({ ask: "sound" });
  }

  open() {
    this.window = window.open(this.path, "sagittal-patient");
  }

  sound() {
    this.channel.postMessage({ set: { sound: this.button.ariaPressed !== "true" } });
  }

  heard(message) {
    if (message.sound === undefined) return;
    this.seen = performance.now();
    this.show(message.sound, true);
  }

  // The patient screen says every second that it is there.
  frame() {
    if (this.seen !== undefined && performance.now() - this.seen > ALIVE_MS) this.show(false, false);
  }

  show(on, there) {
    this.button.disabled = !there;
    this.button.ariaPressed = String(on);
    this.word.textContent = there ? (on ? speak`Sound on` : speak`Sound off`) : speak`Sound`;
  }
}
