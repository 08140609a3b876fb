// <stride-chart>: the stride being walked with the last ones, left solid, right dashed, the last thin.
import { DASH, MEAN_PX, Plot, THIN_PX, label, trace } from "./plot.js";
import { SIDE_KEY, speak } from "../common/words.js";
import { number, say } from "./words.js";

const SIDES = ["left", "right"];
const THIN = 3; // last strides drawn thin, of each side
const THIN_ALPHA = 0.5;
const EDGE = { left: 34, right: 14, top: 20, bottom: 34 };
const TICKS = [0, 20, 40, 60, 80, 100];
const KEEP_S = 3; // of samples behind now: longer than any stride we draw

class StrideChart extends Plot {
  constructor() {
    super();
    this.samples = { left: [], right: [] }; // [t, degrees] of the shown variable
    this.begins = { left: null, right: null };
    this.lasts = { left: 1.1, right: 1.1 }; // s, of the last stride; the first guess is replaced by the first stride
    this.done = { left: [], right: [] };
  }

  // variable: {name, label, range, ticks, up, down}, degrees from standing: the norm's zero is another
  show(variable) {
    this.variable = variable;
    this.samples = { left: [], right: [] };
    this.ask();
  }

  clear() {
    this.samples = { left: [], right: [] };
    this.done = { left: [], right: [] };
    this.begins = { left: null, right: null };
    this.ask();
  }

  frame(message) {
    if (!this.variable) return;
    const times = message.trace?.t ?? [];
    for (const side of SIDES) {
      const s = SIDE_KEY[side];
      const values = message.trace?.[`${this.variable.name}_${s}`];
      const list = this.samples[side];
      times.forEach((t, i) => list.push([t, values?.[i] ?? null]));
      const phase = message.phase?.[s] ?? null;
      this.begins[side] = phase === null ? null : message.t - (phase / 100) * this.lasts[side];
      const from = list.findIndex(([t]) => t >= message.t - KEEP_S);
      if (from > 60) list.splice(0, from);
      say(this.querySelector(`[data-${side}]`), `${number(message.angles_deg?.[`${this.variable.name}_${s}`])}°`);
    }
    this.ask();
  }

  stride(message) {
    const { side } = message;
    this.lasts[side] = message.end_s - message.start_s;
    const same = this.done[side].findIndex((s) => s.n === message.n); // told again when all of it is known
    if (same >= 0) this.done[side][same] = message;
    else this.done[side].push(message);
    if (this.done[side].length > THIN) this.done[side].shift();
    this.ask();
  }

  curve(stride) {
    const c = stride.curves_deg ?? {};
    return c[this.variable.name] ?? c[`${this.variable.name}_${SIDE_KEY[stride.side]}`] ?? null;
  }

  draw(g, { width, height, colour }) {
    const v = this.variable;
    if (!v) return;
    const [low, high] = v.range;
    const w = width - EDGE.left - EDGE.right, h = height - EDGE.top - EDGE.bottom;
    const X = (p) => EDGE.left + (p / 100) * w;
    const Y = (a) => (a === null ? null : EDGE.top + ((high - a) / (high - low)) * h);
    this.scale(g, X, Y, { colour, h, v });
    g.save();
    g.beginPath();
    g.rect(EDGE.left - 1, EDGE.top - 1, w + 2, h + 2);
    g.clip();
    for (const side of SIDES) this.strides(g, side, X, Y, colour);
    g.restore();
    for (const side of SIDES) this.footOff(g, side, X, h, colour);
    label(g, `${v.up} ↑`, X(0) + 5, EDGE.top + 11, { colour: colour.axis, halo: colour.surface });
    label(g, `${v.down} ↓`, X(0) + 5, EDGE.top + h - 5, { colour: colour.axis, halo: colour.surface });
  }

  scale(g, X, Y, { colour, h, v }) {
    g.lineWidth = 1;
    for (const a of v.ticks) {
      g.strokeStyle = a === 0 ? colour.zero : colour.grid;
      trace(g, [[X(0), Y(a)], [X(100), Y(a)]]);
      label(g, `${number(a)}°`, X(0) - 7, Y(a) + 4, { colour: colour.axis, align: "right" });
    }
    for (const p of TICKS) label(g, String(p), X(p), EDGE.top + h + 15, { colour: colour.axis, align: "center" });
    label(g, speak`% of gait cycle`, X(100), EDGE.top + h + 30, { colour: colour.axis, align: "right" });
  }

  strides(g, side, X, Y, colour) {
    g.strokeStyle = colour[side];
    g.setLineDash(side === "right" ? DASH : []);
    g.lineWidth = THIN_PX;
    g.globalAlpha = THIN_ALPHA;
    for (const stride of this.done[side]) {
      const values = this.curve(stride);
      if (values) trace(g, values.map((a, i) => [X((100 * i) / (values.length - 1)), Y(a)]));
    }
    g.globalAlpha = 1;
    const now = this.now(side);
    if (now.length) {
      g.lineWidth = MEAN_PX;
      trace(g, now.map(([p, a]) => [X(p), Y(a)]));
      const [p, a] = now.at(-1);
      g.setLineDash([]);
      if (a !== null) this.head(g, side, X(p), Y(a), colour);
    }
    g.setLineDash([]);
  }

  // Where the stride is now: left a disc, right a ring, so that colour is not alone.
  head(g, side, x, y, colour) {
    g.beginPath();
    g.arc(x, y, 4.5, 0, 2 * Math.PI);
    g.fillStyle = side === "left" ? colour.left : colour.surface;
    g.fill();
    g.lineWidth = 2;
    g.stroke();
  }

  now(side) {
    const begin = this.begins[side];
    if (begin === null) return [];
    const percent = (t) => Math.min((100 * (t - begin)) / this.lasts[side], 100);
    return this.samples[side].filter(([t]) => t >= begin).map(([t, a]) => [percent(t), a]);
  }

  footOff(g, side, X, h, colour) {
    const last = this.done[side].at(-1);
    if (!last || last.foot_off_pct === null || last.foot_off_pct === undefined) return;
    const x = X(last.foot_off_pct);
    g.strokeStyle = colour[side];
    g.lineWidth = 1.25;
    g.setLineDash(side === "right" ? [4, 3] : []);
    trace(g, [[x, EDGE.top], [x, EDGE.top + h]]);
    g.setLineDash([]);
    const other = this.done[side === "left" ? "right" : "left"].at(-1)?.foot_off_pct ?? null;
    const first = other === null ? side === "left" : last.foot_off_pct <= other && !(other === last.foot_off_pct && side === "right");
    label(g, `${side === "left" ? "L" : "R"} ${number(last.foot_off_pct)}`, x + (first ? -3 : 3), EDGE.top - 6, {
      colour: colour[`${side}-ink`], align: first ? "right" : "left", bold: true,
    });
  }
}

customElements.define("stride-chart", StrideChart);
