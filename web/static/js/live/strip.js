// <target-strip>: the last 20 strides against the target zone. In the zone = disc, near = triangle, away = square;
// without a target left = disc, right = ring. A petrol tick below marks a stride with feedback.
import { Plot, label, trace } from "./plot.js";
import { number } from "./words.js";
import { findRoundTicks } from "../common/ticks.js";
import { speak } from "../common/words.js";

export const SHOWN = 20;
const EDGE = { left: 44, right: 84, top: 10, bottom: 42 };
const MARK = 6.5;

class TargetStrip extends Plot {
  /** @typedef {{ value: number | null, kind: string, cued: boolean, cue: any }} Row */
  /** @type {Row[] | undefined} */
  rows;

  /**
   * A stride was judged by the zone of its cue, so the band steps where the level changed.
   * @param {Row[]} rows oldest first; kind: in, near, away, left, right or none
   * @param {[number, number] | null} zone of the next stride, low and high
   * @param {number} digits
   */
  show(rows, zone, digits) {
    this.rows = rows;
    this.zone = zone;
    this.digits = digits;
    this.ask();
  }

  range() {
    const values = this.rows.map((r) => r.value).filter((v) => v !== null);
    const all = [...values, ...this.zones().flat()].filter(Number.isFinite);
    if (!all.length) return null;
    const [low, high] = [Math.min(...all), Math.max(...all)];
    const least = 4 * 10 ** -this.digits; // never so close that rounding shows as walking
    const room = Math.max(0.25 * (high - low), (least - (high - low)) / 2, least / 4);
    return [low - room, high + room];
  }

  /**
   * The zone of each of the places, oldest first; none without a target.
   * @returns {[number, number][]}
   */
  zones() {
    if (!this.zone) return [];
    /** @type {([number, number] | null)[]} */
    const known = this.rows.map((r) => (r.cue ? [r.cue.zone_low, r.cue.zone_high] : null));
    let last = this.zone;
    for (let i = known.length - 1; i >= 0; i--) last = known[i] ??= last;
    return [...Array(SHOWN - known.length).fill(last), ...known];
  }

  draw(g, { width, height, colour }) {
    const w = width - EDGE.left - EDGE.right, h = height - EDGE.top - EDGE.bottom;
    const range = this.rows && this.range();
    const X = (i) => EDGE.left + ((i + 0.5) / SHOWN) * w;
    if (!range) return;
    const Y = (v) => EDGE.top + ((range[1] - v) / (range[1] - range[0])) * h;
    this.target(g, Y, w, colour);
    const { ticks, digits } = findRoundTicks(range[0], range[1]);
    g.lineWidth = 1;
    for (const v of ticks) {
      g.strokeStyle = colour.grid;
      if (!this.zone || v < this.zone[0] || v > this.zone[1]) trace(g, [[EDGE.left, Y(v)], [EDGE.left + w, Y(v)]]);
      label(g, number(v, digits), EDGE.left - 7, Y(v) + 4, { colour: colour.axis, align: "right" });
    }
    const first = SHOWN - this.rows.length;
    const tick = EDGE.top + h + 10;
    this.rows.forEach((row, i) => {
      if (row.value !== null) mark(g, row.kind, X(first + i), Y(row.value), colour);
      if (row.cued) {
        g.strokeStyle = colour.accent;
        g.lineWidth = 4;
        trace(g, [[X(first + i) - 7, tick], [X(first + i) + 7, tick]]);
      }
    });
    const under = EDGE.top + h + 30;
    const places = { 0: speak`${SHOWN} ago`, 5: "15", 10: "10", 15: "5", [SHOWN - 1]: speak`now` };
    for (const [i, text] of Object.entries(places))
      label(g, text, X(Number(i)), under, { colour: colour.axis, align: "center" });
    if (this.rows.some((r) => r.cued)) label(g, speak`feedback`, EDGE.left + w + 8, tick + 4, { colour: colour.axis });
  }

  target(g, Y, w, colour) {
    if (!this.zone) return;
    const zones = this.zones(), X = (i) => Math.round(EDGE.left + (i / SHOWN) * w);
    g.fillStyle = colour.target;
    zones.forEach(([low, high], i) => g.fillRect(X(i), Y(high), X(i + 1) - X(i), Y(low) - Y(high)));
    g.strokeStyle = colour["target-line"];
    g.lineWidth = 1.25;
    for (const end of [0, 1]) trace(g, zones.flatMap((z, i) => [[X(i), Y(z[end])], [X(i + 1), Y(z[end])]]));
    const [low, high] = zones[SHOWN - 1];
    label(g, speak`target`, EDGE.left + w + 8, Y((low + high) / 2) + 4, { colour: colour.ink, bold: true });
  }
}

export function mark(g, kind, x, y, colour, r = MARK) {
  g.beginPath();
  g.lineWidth = 2;
  if (kind === "near") {
    g.moveTo(x, y - r - 1);
    g.lineTo(x + r + 1, y + r - 0.5);
    g.lineTo(x - r - 1, y + r - 0.5);
    g.closePath();
    g.fillStyle = colour.surface;
    g.strokeStyle = colour.warn;
  } else if (kind === "away") {
    g.rect(x - r + 0.5, y - r + 0.5, 2 * r - 1, 2 * r - 1);
    g.fillStyle = colour.surface;
    g.strokeStyle = colour.bad;
  } else {
    g.arc(x, y, kind === "right" ? r - 1 : r, 0, 2 * Math.PI);
    g.fillStyle = { in: colour.ok, left: colour.left, right: colour.surface }[kind] ?? colour["ink-3"];
    g.strokeStyle = { in: colour.ok, left: colour.left, right: colour.right }[kind] ?? colour["ink-3"];
  }
  g.fill();
  g.stroke();
}

customElements.define("target-strip", TargetStrip);
