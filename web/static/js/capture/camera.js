// The tablet's camera beside the take: asked for, shown, recorded. Nothing of it may disturb the take, so whatever
// fails is said in the camera's own card.
import { fixed, formatClock, speak } from "../common/words.js";
import { FilmOutbox } from "./film.js";

const PIECE_MS = 1000;
const RESERVE = 0.98; // of the server's limit
const FORMATS = ["video/webm;codecs=vp8", "video/webm;codecs=vp9", "video/webm", "video/mp4"];
const REASONS = {
  NotAllowedError: speak`Camera access was denied. Allow it in the browser's settings for this page, then tick the box again.`,
  NotFoundError: speak`This device has no camera.`,
  NotReadableError: speak`Another program is using the camera. Close it, then tick the box again.`,
};

// Why there is no camera here, or null.
function whyNot() {
  if (!window.isSecureContext) return speak`Filming requires an https address.`;
  if (!navigator.mediaDevices?.getUserMedia || !window.MediaRecorder) return speak`This browser cannot record video.`;
  return FORMATS.some((format) => MediaRecorder.isTypeSupported(format)) ? null : speak`This browser cannot record video.`;
}

export class Camera {
  // page: the sign that it films is in view wherever the page is scrolled to.
  constructor(page) {
    this.$ = (name) => page.querySelector(`[data-${name}]`);
    const card = this.card = this.$("camera");
    this.limit = Number(card.dataset.limitBytes) * RESERVE;
    this.bitsPerS = Number(card.dataset.bitsPerS);
    this.front = false;
    this.stream = this.recorder = this.outbox = null;
    this.problem = whyNot();
    this.$("consent").addEventListener("change", () => this.choose());
    this.$("turn").addEventListener("click", () => this.turn());
    this.$("hide").addEventListener("click", () => this.hide());
    this.$("stop-film").addEventListener("click", () => this.end());
  }

  // Films of an earlier page go on to the server.
  async wake() {
    if (await FilmOutbox.exists()) await this.keepFilms();
    this.draw();
  }

  async keepFilms() {
    if (this.outbox) return;
    try {
      this.outbox = await FilmOutbox.open(() => this.sent());
    } catch {
      this.problem = speak`This browser does not store data for this page, so it cannot record video.`;
    }
  }

  sent() {
    if (this.recorder && this.outbox.lost) this.end(); // it is not wanted any more
    this.draw();
  }

  async choose() {
    if (!this.$("consent").checked) return this.close();
    await this.open();
  }

  async open() {
    this.close();
    this.problem = null;
    const video = { facingMode: { ideal: this.front ? "user" : "environment" }, width: { ideal: 1280 }, height: { ideal: 720 }, frameRate: { ideal: 30 } };
    try {
      const stream = await navigator.mediaDevices.getUserMedia({ video, audio: false });
      if (!this.$("consent").checked) return stop(stream); // taken back while the browser asked
      this.stream = stream;
      await this.keepFilms();
      stream.getVideoTracks()[0].addEventListener("ended", () => this.gone());
      this.$("preview").srcObject = stream;
    } catch (error) {
      this.problem = REASONS[error.name] ?? speak`Camera error: ${error.message}`;
      this.$("consent").checked = false;
    }
    this.draw();
  }

  // The camera was taken away: unplugged, or by another program.
  async gone() {
    this.problem = speak`The camera was disconnected. Recording continues without video.`;
    await this.end();
  }

  async turn() {
    this.front = !this.front;
    await this.open();
  }

  hide() {
    this.hidden = !this.hidden;
    this.draw();
  }

  // The take starts.
  async begin(paired) {
    if (!this.stream || !this.outbox) return this.close();
    try {
      const mimeType = FORMATS.find((format) => MediaRecorder.isTypeSupported(format));
      const recorder = new MediaRecorder(this.stream, { mimeType, videoBitsPerSecond: this.bitsPerS });
      let begun = null; // the film has its number before its first piece
      recorder.addEventListener("start", () => {
        begun = this.outbox.begin(paired, Math.round((performance.timeOrigin + performance.now()) * 1000));
        this.beganMs = performance.now();
        this.draw();
      });
      recorder.addEventListener("dataavailable", ({ data }) => begun?.then(() => this.keep(data)).catch((error) => this.full(error)));
      recorder.addEventListener("error", () => this.gone());
      recorder.start(PIECE_MS);
      this.recorder = recorder;
    } catch (error) {
      this.problem = speak`Camera error: ${error.message}`;
      this.close();
    }
    this.draw();
  }

  async keep(piece) {
    if (!piece.size || !this.outbox.current) return;
    if (this.outbox.bytes + piece.size <= this.limit) return this.outbox.add(piece);
    this.problem = speak`The video reached its size limit and stopped. Recording continues.`;
    await this.end();
  }

  async full(error) {
    const words = error.name === "QuotaExceededError" ? speak`This tablet has no storage left.` : error.message;
    this.problem = speak`The video stopped: ${words} Recording continues.`;
    await this.end();
  }

  // The take is over, or nobody is to be filmed any more.
  async end() {
    const { recorder } = this;
    this.recorder = null;
    if (recorder && recorder.state !== "inactive") {
      const last = new Promise((ok) => recorder.addEventListener("stop", ok, { once: true }));
      recorder.stop();
      await last;
    }
    this.$("consent").checked = false;
    this.close();
    await this.outbox?.end();
    this.draw();
  }

  close() {
    if (this.stream) stop(this.stream);
    this.stream = null;
    this.$("preview").srcObject = null;
    this.draw();
  }

  // state: of the page.
  draw(state = this.state) {
    this.state = state;
    const films = Boolean(this.recorder), on = Boolean(this.stream), choosing = state === "prepare";
    const said = this.problem ?? this.outbox?.lost ?? (films ? null : this.onTheWay());
    this.card.hidden = !(choosing || films || (["running", "sending", "done", "pairing"].includes(state) && said));
    this.$("ask").hidden = !choosing;
    this.$("consent").disabled = Boolean(whyNot());
    this.$("turn").hidden = !choosing || !on;
    this.$("hide").hidden = !on;
    set(this.$("hide"), this.hidden ? speak`Show camera picture` : speak`Hide camera picture`);
    this.$("preview").hidden = !on || Boolean(this.hidden);
    this.$("stop-film").hidden = !films;
    this.$("films").hidden = !films;
    if (films) set(this.$("films-for"), formatClock((performance.now() - this.beganMs) / 1000 || 0, 1));
    this.$("film-say").hidden = !said;
    set(this.$("film-say"), said ?? "");
  }


  onTheWay() {
    const { held, left } = this.outbox ?? {};
    if (held) return speak`${fixed(held / 1e6, 1)} MB of video still to upload. Keep this page open.`;
    if (!left) return null;
    return this.state === "running" ? speak`Filming has ended. The video is stored with the trial.` : speak`The video is being added to the trial.`;
  }
}

function stop(stream) {
  for (const track of stream.getTracks()) track.stop();
}

function set(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
