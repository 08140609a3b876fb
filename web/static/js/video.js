// <take-video>: a film of the walk in step with curves and figure. Aligned by one moment that both show.
import { request, showProblem } from "./common/api.js";
import { clock } from "./clock.js";
import { fixed, speak, translate } from "./common/words.js";

const FRAME_S = 1 / 30;
const APART_S = { playing: 0.08, still: 0.01 }; // a playing film is put right only when it is seen to be off
const END_S = 1e9;

class TakeVideo extends HTMLElement {
  connectedCallback() {
    this.video = this.querySelector("video");
    this.text = this.querySelector("[data-say]");
    this.form = this.querySelector("[data-align]");
    this.offset = this.hasAttribute("offset") ? Number(this.getAttribute("offset")) : null;
    this.aligning = this.offset === null;
    clock.addEventListener("tick", () => this.follow());
    this.video.addEventListener("loadedmetadata", () => this.measure());
    this.video.addEventListener("durationchange", () => this.measured());
    this.video.addEventListener("timeupdate", () => this.slide());
    this.video.addEventListener("error", () => this.say(speak`This browser cannot play the video.`));
    if (this.form) this.tools();
    this.show();
    if (this.video.readyState > 0) this.measure();
  }

  tools() {
    const slider = this.querySelector("#video-time");
    slider.addEventListener("input", () => { this.video.currentTime = slider.value * this.length(); });
    for (const b of this.querySelectorAll("[data-frame]")) b.addEventListener("click", () => { this.video.currentTime += b.dataset.frame * FRAME_S; });
    this.querySelector("[data-same]").addEventListener("click", () => this.align());
    this.querySelector("[data-realign]").addEventListener("click", () => {
      this.aligning = true;
      this.video.pause();
      this.show();
    });
  }

  // A film of a browser's own recorder does not say how long it is before it was looked at to its end.
  measure() {
    if (Number.isFinite(this.video.duration)) return this.measured();
    this.video.currentTime = END_S;
  }

  measured() {
    if (!Number.isFinite(this.video.duration) || this.dataset.length) return;
    this.dataset.length = String(this.video.duration);
    this.video.currentTime = 0;
    this.follow();
  }

  length() { return Number(this.dataset.length ?? 0); }

  slide() {
    const slider = this.querySelector("#video-time");
    if (slider && this.length()) slider.value = String(this.video.currentTime / this.length());
  }

  // The contact that the picked stride begins with: there the figure stands after J, K or a click on a stride.
  show() {
    if (this.form) this.form.hidden = !this.aligning;
    const again = this.querySelector("[data-realign]");
    if (again) again.hidden = this.aligning;
    if (!this.aligning) return this.follow();
    this.say(this.form ? "" : speak`Not aligned with the trial yet.`);
    this.follow();
  }

  follow() {
    if (this.aligning) {
      const s = clock.stride, button = this.querySelector("[data-same]");
      if (button && s) button.textContent = speak`Same moment as the ${translate(s.side)} contact at ${fixed(s.start_s, 2)} s`;
      return;
    }
    const want = clock.t + this.offset, inside = want >= 0 && want <= this.length();
    this.say(inside || !this.length() ? "" : speak`The video does not show this moment.`);
    if (!inside) return this.video.pause();
    const apart = Math.abs(this.video.currentTime - want);
    if (clock.playing) {
      this.video.playbackRate = clock.speed;
      if (this.video.paused) this.video.play().catch(() => {}); // paused again meanwhile
      if (apart > APART_S.playing) this.video.currentTime = want;
    } else {
      this.video.pause();
      if (apart > APART_S.still) this.video.currentTime = want;
    }
  }

  async align() {
    const offset = this.video.currentTime - clock.stride.start_s;
    try {
      await request("PATCH", `/api/v1/sessions/${this.getAttribute("session")}/video`, { offset_s: offset });
    } catch (problem) {
      return showProblem(this.querySelector(".form-error"), problem);
    }
    this.offset = offset;
    this.setAttribute("offset", String(offset));
    this.aligning = false;
    this.show();
  }

  say(words) {
    if (this.text.textContent !== words) this.text.textContent = words;
    this.text.hidden = !words;
  }
}

customElements.define("take-video", TakeVideo);
