// One signal over time. The whole take is loaded once, thinned; a closer look loads its own window with margins.
import { request } from "../common/api.js";
import { SIDE_KEY, SIDE_LETTER } from "../common/words.js";
import { h, s } from "../common/elements.js";
import { findRoundTicks } from "../common/ticks.js";
import { seconds } from "./words.js";

const MS = 1000;
const TICKS = 3; // at most about so many on a lane
const COARSE_POINTS = 2000;
const WAIT_MS = 90;
const DENSE_S = 0.08;
const MARGIN = 1; // so many windows on each side are loaded along
const CLASS = { left: "tl-l", right: "tl-r", both: "tl-x", x: "tl-x", y: "tl-y", z: "tl-z" };
const SHORT = { ...SIDE_LETTER, both: "" };

export class SignalLane {
  constructor(host, values, session, win) {
    this.host = host;
    this.values = values;
    this.win = win;
    this.top = this.bottom = 0;
    this.path = `/api/v1/sessions/${session}/signals`;
    this.group = s("g");
    this.svg = s("svg", { class: "chart tl-lines", preserveAspectRatio: "none", "aria-hidden": "true" }, this.group);
    this.words = h("span", { class: "tl-up xs" });
    this.lines = h("div", { class: "tl-ticks" });
    this.marks = h("div", { class: "tl-ticks" });
    host.append(this.lines, this.svg, this.words, this.marks);
    win.addEventListener("move", () => this.move());
  }

  // Another signal; answers of an earlier one that come late are dropped.
  async open(lane) {
    this.lane = lane;
    this.coarse = this.fine = null;
    this.host.setAttribute("aria-busy", "true");
    this.group.replaceChildren();
    const coarse = await this.load(0, this.win.duration, COARSE_POINTS);
    if (this.lane !== lane) return;
    this.host.removeAttribute("aria-busy");
    this.coarse = coarse;
    this.scale();
    this.move();
  }

  async load(start, end, points) {
    const query = new URLSearchParams({ start_s: start, end_s: end, points });
    const piece = await request("GET", `${this.path}/${this.lane.name}?${query}`);
    const count = Object.values(piece.low)[0]?.length ?? 0;
    return { ...piece, end_s: piece.start_s + (count - 1) * piece.step_s };
  }

  // The y axis is that of the whole take, so that a zoom never changes how high a curve looks.
  scale() {
    let [least, most] = [Infinity, -Infinity];
    for (const [line, low] of Object.entries(this.coarse.low)) {
      for (const v of low) if (v !== null && v < least) least = v;
      for (const v of this.coarse.high[line]) if (v !== null && v > most) most = v;
    }
    if (least > most) [least, most] = [0, 1];
    const room = Math.max((most - least) * 0.08, 1e-6);
    [this.bottom, this.top] = [least - room, most + room];
    this.digits = most - least < 5 ? 2 : 0;
    this.words.textContent = `${this.lane.up} ↑`;
    const { ticks, digits } = findRoundTicks(this.bottom, this.top, TICKS);
    this.lines.replaceChildren(...ticks.map((v) => this.place(h("i", { class: v === 0 ? "zero" : "" }), v)));
    this.marks.replaceChildren(...ticks.map((v) => this.place(h("span", { class: "xs num" }, `${seconds(v, digits)}${this.unit}`), v)));
  }

  place(mark, v) {
    mark.style.setProperty("--at", `${this.y(v) / 10}%`);
    return mark;
  }

  get unit() {
    return this.lane.unit === "°" ? "°" : ` ${this.lane.unit}`;
  }

  y(v) {
    return (1000 * (this.top - v)) / (this.top - this.bottom);
  }

  move() {
    if (!this.coarse) return;
    const wanted = this.win.span / Math.max(this.host.clientWidth, 200);
    const rough = this.coarse.step_s > wanted * 1.5;
    const fits = (p) => p && p.start_s <= this.win.start + p.step_s && p.end_s >= this.win.end - p.step_s && (p.step_s <= wanted * 1.5 || p.exact);
    if (!rough) this.draw(this.coarse);
    else if (fits(this.fine)) this.draw(this.fine);
    else {
      // what is there is shown at once, the sharper picture follows
      this.draw(this.fine && this.fine.start_s <= this.win.start && this.fine.end_s >= this.win.end ? this.fine : this.coarse);
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.sharpen(), WAIT_MS);
    }
    this.svg.setAttribute("viewBox", `${(this.win.start - this.drawn.start_s) * MS} 0 ${this.win.span * MS} 1000`);
  }

  async sharpen() {
    const { lane, win } = this;
    const margin = MARGIN * win.span;
    const [from, to] = [Math.max(win.start - margin, 0), Math.min(win.end + margin, win.duration)];
    const points = Math.min(Math.ceil((this.host.clientWidth * (to - from)) / win.span), 4000);
    try {
      const fine = await this.load(from, to, points);
      if (this.lane !== lane) return;
      fine.exact = fine.low === fine.high || Object.keys(fine.low).every((k) => fine.low[k].every((v, i) => v === fine.high[k][i]));
      this.fine = fine;
      this.move();
    } catch {
      // the coarse picture stays; the next move asks again
    }
  }

  draw(piece) {
    if (this.drawn === piece) return;
    this.drawn = piece;
    // where a pixel holds a whole swing, both feet must be seen through each other
    this.svg.classList.toggle("dense", piece.step_s > DENSE_S);
    this.group.replaceChildren(...Object.keys(piece.low).map((line) => s("path", { class: CLASS[line], d: this.trace(piece, line) })));
  }

  // From the least to the greatest value of every part and on to the next; a lost part is a hole.
  trace(piece, line) {
    const [low, high] = [piece.low[line], piece.high[line]];
    const step = piece.step_s * MS;
    let d = "";
    let pen = "M";
    for (let i = 0; i < low.length; i++) {
      if (low[i] === null) {
        pen = "M";
        continue;
      }
      const x = Math.round(10 * i * step) / 10;
      d += `${pen}${x} ${this.y(low[i]).toFixed(1)}`;
      if (high[i] !== low[i]) d += `L${x} ${this.y(high[i]).toFixed(1)}`;
      pen = "L";
    }
    return d;
  }

  // Values at a moment, in the label beside the lane.
  read(t) {
    const piece = this.drawn;
    if (!piece) return;
    const i = Math.round((t - piece.start_s) / piece.step_s);
    const parts = Object.entries(piece.low).map(([line, low]) => {
      const v = low[i];
      const text = v === null || v === undefined ? "–" : seconds(v, this.digits + (this.digits ? 0 : 1));
      return h("span", { class: SIDE_KEY[line] ? `leg ${SIDE_KEY[line]}` : "" }, `${SHORT[line] ?? line} ${text}`);
    });
    this.values.replaceChildren(...parts, h("span", { class: "dim" }, this.unit.trim()));
  }
}
