// <live-view> shows the live figure of a session: viser's page in an iframe, loaded when it is first seen, again
// when the theme changes and when the line to the server has come back. Viser's own client only tries again while
// it has focus, which an iframe rarely has, so it is not waited for.
import { speak } from "../common/words.js";
const RETRY_MS = 5000;

const isDark = () => getComputedStyle(document.documentElement).colorScheme.startsWith("dark");

class LiveView extends HTMLElement {
  connectedCallback() {
    this.frame = this.querySelector("iframe");
    this.frame.addEventListener("load", () => { if (this.dataset.state === "loading") this.#state("open", ""); });
    this.seen = new IntersectionObserver((entries) => {
      if (!entries.some((e) => e.isIntersecting)) return;
      this.seen.disconnect();
      this.open();
    });
    this.seen.observe(this);
    this.recolour = () => { if (this.dataset.state && this.dark !== isDark()) this.open(); };
    this.theme = new MutationObserver(this.recolour);
    this.theme.observe(document.documentElement, { attributeFilter: ["data-theme"] });
    this.scheme = matchMedia("(prefers-color-scheme: dark)");
    this.scheme.addEventListener("change", this.recolour);
  }

  disconnectedCallback() {
    this.seen.disconnect();
    this.theme.disconnect();
    this.scheme.removeEventListener("change", this.recolour);
    clearTimeout(this.timer);
  }

  // The page around knows the state of the line: after it was lost the server may be a new one.
  line(line) {
    if (line === "lost") this.lost = true;
    else if (line === "open" && this.lost) {
      this.lost = false;
      if (this.dataset.state) this.open();
    }
  }

  async open() {
    clearTimeout(this.timer);
    this.dark = isDark();
    this.#state("loading", speak`Opening the 3D view…`);
    const asked = (this.asked = Symbol("asked"));
    let problem = null;
    try {
      const answer = await fetch(`/sessions/${this.getAttribute("session")}/live/figure?dark=${this.dark}`, { cache: "no-store" });
      if (asked !== this.asked) return; // asked for again meanwhile
      const body = await answer.json();
      if (answer.ok) this.#load(body.src);
      else problem = body.detail ?? body.title;
    } catch {
      if (asked === this.asked) problem = speak`The 3D view is unavailable.`;
    }
    if (problem === null) return;
    this.#state("lost", problem);
    this.timer = setTimeout(() => this.open(), RETRY_MS);
  }

  #load(src) {
    this.frame.hidden = false;
    if (this.frame.getAttribute("src") === src) this.frame.contentWindow.location.reload();
    else this.frame.src = src;
  }

  #state(state, words) {
    this.dataset.state = state;
    const say = this.querySelector("[data-say]");
    if (say && say.textContent !== words) say.textContent = words;
  }
}

customElements.define("live-view", LiveView);
