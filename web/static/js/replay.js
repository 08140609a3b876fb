// <gait-view> shows the 3D figure (an iframe) and sends it the time; <time-bar> plays, pauses and seeks.
import { clock } from "./clock.js";
import { fixed, localise, speak, translate } from "./common/words.js";

const RATE_MS = 33; // the figure is posed at most 30 times a second (docs/reference/architecture.md, "The 3D figure")
const RETRY_MS = [500, 1000, 2000, 5000];
const FADE_MS = 400; // longer than the first picture takes to go (pages.css)
const LINE_MS = 3500; // shorter than the server keeps a client waiting for its view (viewer/views.py)
const PATIENCE_MS = 30_000; // a 3D view that has not said by then that it has drawn is shown as it is

const isDark = () => getComputedStyle(document.documentElement).colorScheme.startsWith("dark");

// One view per browser tab: a reload finds it again, a second tab has its own.
function tabId() {
  try {
    sessionStorage.tab ??= crypto.getRandomValues(new Uint32Array(2)).join("");
    return sessionStorage.tab;
  } catch {
    return "";
  }
}

const SEGMENTS = {
  pelvis: speak`pelvis`, thigh_l: speak`left thigh`, thigh_r: speak`right thigh`, shank_l: speak`left lower leg`,
  shank_r: speak`right lower leg`, foot_l: speak`left foot`, foot_r: speak`right foot`,
};

// 32 hexadecimal digits, the page's own name for a view that the server is still opening
const makeName = () => Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");

const setting = (button) => ({ [button.dataset.switch]: button.ariaPressed === "true" });

class GaitView extends HTMLElement {
  connectedCallback() {
    this.frame = this.querySelector("iframe");
    this.first = this.querySelector("[data-first]") ?? this.makeCover();
    this.tries = 0;
    addEventListener("message", (e) => {
      if (e.source !== this.frame.contentWindow || e.origin !== location.origin) return;
      if (e.data === "drawn") this.uncover();
      if (e.data === "no-3d") this.say(this.lacking = speak`This browser does not support 3D. All values are in the charts and the table.`);
    });
    this.onTick = () => this.request();
    clock.addEventListener("tick", this.onTick);
    const recolour = () => this.tell({ dark: isDark() });
    new MutationObserver(recolour).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
    this.options = this.parentElement.querySelector("[data-options]");
    this.switches = [...this.options.querySelectorAll("[data-switch]")];
    for (const b of this.switches) {
      b.addEventListener("click", () => {
        b.ariaPressed = b.ariaPressed !== "true";
        this.tell(setting(b));
        if (b.dataset.switch === "follow") this.look.value = "near"; // the camera goes back there
      });
    }
    this.look = this.options.querySelector("[data-look]");
    this.look.addEventListener("change", () => {
      this.tell({ look: this.look.value });
      this.options.querySelector("[data-switch=follow]").ariaPressed = "true";
    });
    this.ghosts = this.options.querySelector("[data-ghosts]"); // a take without strides has none
    this.ghosts?.addEventListener("change", () => this.tell({ ghost: this.ghosts.value || null }));
    this.options.querySelector("[data-picture]").addEventListener("click", () => this.savePicture());
    this.options.querySelector("[data-video]").addEventListener("click", (e) => this.record(e.currentTarget));
    this.connect();
  }

  disconnectedCallback() {
    clock.removeEventListener("tick", this.onTick);
    clearTimeout(this.timer);
    this.socket?.close();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const query = new URLSearchParams({ tab: tabId(), dark: String(isDark()), t: String(clock.t) });
    const client = this.tries ? null : this.getAttribute("client");
    if (client) {
      this.view = makeName();
      query.set("view", this.view);
      this.load(`${client}#${this.view}${isDark() ? ",dark" : ""}`);
    }
    if (this.dataset.ghost) query.set("ghost", this.dataset.ghost);
    this.socket = new WebSocket(`${scheme}://${location.host}${this.getAttribute("replay")}?${query}`);
    this.socket.onmessage = (e) => this.receive(JSON.parse(e.data));
    this.socket.onclose = (e) => {
      this.dataset.state = "lost";
      this.waiting = false;
      if (e.code === 1008 && e.reason === "not_found") this.say(speak`You no longer have access to this patient.`);
      if (e.code === 1008 || this.refused) return; // signed out or nothing to show: trying again would not help
      this.say(speak`Connection lost, trying again…`);
      this.timer = setTimeout(() => this.connect(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
    };
  }

  // The server answers with the address of this tab's private view; after a restart it is a new one, so the frame
  // is loaded again rather than left to a client that only retries while it has focus.
  receive(message) {
    if (message.error) {
      this.refused = message.error.code !== "bad_message";
      if (this.refused) {
        this.frame.hidden = true;
        this.uncover();
      }
      this.say(translate(message.error.detail));
    } else if (message.src) {
      this.tries = 0;
      // a client that waited for long has let go of its line
      if (message.view !== this.view || performance.now() - this.loadedAt > LINE_MS) this.load(message.src);
      this.view = null; // after a lost line it is another
      this.dataset.state = "open";
      this.say("");
      this.options.hidden = false;
      this.options.querySelector("[data-switch=follow]").hidden = !message.placed;
      this.options.querySelector("[data-estimated]").hidden = message.measured;
      const unseen = this.options.querySelector("[data-unseen]");
      unseen.hidden = !message.hidden.length;
      unseen.textContent = speak`Not shown because there are no sensors: ${message.hidden.map((segment) => SEGMENTS[segment]).join(", ")}.`;
      for (const b of this.switches) this.tell(setting(b));
      if (this.look.value !== "near") this.tell({ look: this.look.value });
      if (this.ghosts) this.tell({ ghost: this.ghosts.value || null });
      this.send();
    } else if (message.ghost !== undefined) {
      this.dataset.ghostShown = message.ghost ?? "";
      const wanted = this.ghosts?.value && this.ghosts.selectedOptions[0].text.trim();
      this.lacking = wanted && !message.ghost ? (translate(message.why) ?? speak`This overlay is not available: ${wanted}`) : "";
      this.say(this.lacking);
    } else if (message.t !== undefined) {
      this.waiting = false;
      this.dataset.shown = message.t;
      this.say(message.valid === false ? speak`No data at this moment` : (this.lacking ?? ""));
      if (this.sent !== clock.t) this.request();
    }
  }

  load(address) {
    if (this.refused) return;
    this.frame.src = address;
    this.loadedAt = performance.now();
    this.frame.hidden = false;
    setTimeout(() => this.uncover(), PATIENCE_MS);
  }

  // Where there is no drawing: an empty view must not shine white out of a dark page.
  makeCover() {
    const cover = document.createElement("div");
    cover.dataset.first = "";
    this.frame.after(cover);
    return cover;
  }

  // The figure is there: what is in front of it goes.
  uncover() {
    const first = this.first;
    this.first = null;
    if (!first) return;
    first.classList.add("gone");
    setTimeout(() => first.remove(), FADE_MS);
    this.dataset.drawn = "";
    this.say(this.lacking ?? "");
  }

  tell(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  say(text) {
    const el = this.querySelector("[data-say]");
    const said = text || (this.first ? speak`Opening the 3D view…` : "");
    if (el && el.textContent !== said) el.textContent = said;
  }

  // The one that the figure is drawn on, once it is; viser has others.
  canvas() {
    return this.first ? null : this.frame.contentDocument?.querySelector("canvas[data-engine]");
  }

  async savePicture() {
    const canvas = this.canvas();
    if (!canvas || this.saving) return;
    this.saving = true;
    try {
      const { savePicture } = await import("./figure-export.js");
      await savePicture(canvas, () => this.tell({ t: clock.t }), `figure-${clock.t.toFixed(2)}s.png`, this.frame);
    } catch (problem) {
      this.say(problem.message);
    } finally {
      this.saving = false;
    }
  }

  // From the press on, while the walk plays, until the next press.
  async record(button) {
    if (this.recording) {
      this.recording.stop();
      return;
    }
    if (!this.canvas()) return;
    const { recordVideo } = await import("./figure-export.js");
    this.recording = recordVideo(this.canvas(), `figure-${clock.t.toFixed(2)}s`, () => {
      this.recording = null;
      button.ariaPressed = "false";
      button.textContent = speak`Record video`;
      if (clock.playing) clock.toggle();
    });
    button.ariaPressed = "true";
    button.textContent = speak`Stop and save`;
    if (!clock.playing) clock.toggle();
  }

  request() {
    if (this.waiting || this.queued) return;
    this.queued = setTimeout(() => { this.queued = null; this.send(); }, RATE_MS);
  }

  send() {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    this.sent = clock.t;
    this.waiting = true;
    this.tell({ t: clock.t });
  }
}

class TimeBar extends HTMLElement {
  connectedCallback() {
    this.button = this.querySelector("[data-play]");
    this.range = this.querySelector("input");
    this.out = this.querySelector("output");
    this.range.max = clock.duration;
    this.button.addEventListener("click", () => clock.toggle());
    this.range.addEventListener("input", () => clock.set(Number(this.range.value)));
    document.querySelector("[data-speed]")?.addEventListener("change", (e) => (clock.speed = Number(e.target.value)));
    clock.addEventListener("tick", () => this.show());
    this.show();
  }

  show() {
    this.range.value = clock.t;
    this.range.style.setProperty("--at", clock.duration ? clock.t / clock.duration : 0);
    this.out.textContent = localise(`${clock.t.toFixed(clock.duration < 100 ? 1 : 0)} s`);
    const p = clock.percent;
    const where = p === null ? "" : speak`, ${Math.round(p)} percent of a ${translate(clock.stride.side)} ${translate(clock.called)}`;
    this.range.setAttribute("aria-valuetext", speak`${fixed(clock.t, 1)} seconds${where}`);
    if (this.button.dataset.on === String(clock.playing)) return;
    this.button.dataset.on = clock.playing;
    this.button.setAttribute("aria-label", clock.playing ? speak`Pause` : speak`Play`);
    this.button.querySelector("use").setAttribute("href", clock.playing ? "#i-pause" : "#i-play");
  }
}

customElements.define("gait-view", GaitView);
customElements.define("time-bar", TimeBar);
