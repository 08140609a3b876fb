// Which way this device's sensors point, found by turning it: lying, on its left edge, upright, lying again.
// Browsers disagree: on the sign of acceleration, on which axis alpha, beta and gamma turn about, on degrees. Gravity
// decides: between two poses the turned-along gravity g' = g − (ω × g) dt must arrive where it is measured.
import { fixed, speak } from "../../common/words.js";
export const POSES = [
  { name: "flat", axis: 2, words: speak`Lay the device flat, screen up` },
  { name: "side", axis: 0, words: speak`Stand it on its left long edge` },
  { name: "upright", axis: 1, words: speak`Stand it upright, top edge up` },
  { name: "flat again", axis: 2, words: speak`Lay it flat again, screen up` },
];
const GRAVITY = 9.81, OFF = 1.5; // m/s²; phones read up to a tenth beside it
const STILL_S = 0.8;
const STILL_SPREAD = 0.35; // m/s² over the still time
const ALONG = 0.92; // share of gravity on the pose's axis, about 23°
const FITS_DEG = 15, OTHERS_DEG = 30; // the right reading must fit, and every other one must not
const TURN_DEG = 45;
const MOST_TURNING = 3.5; // rad on the way of a quarter turn: three quarters the other way would end the same

const length = (v) => Math.hypot(...v);
const mean = (rows, key) => [0, 1, 2].map((i) => rows.reduce((sum, row) => sum + row[key][i], 0) / rows.length);
const dot = (a, b) => a.reduce((sum, v, i) => sum + v * b[i], 0);
const angleDeg = (a, b) => (Math.acos(Math.max(-1, Math.min(1, dot(a, b) / (length(a) * length(b))))) * 180) / Math.PI;

// All ways to read three rates as right-handed or left-handed axes, in degrees or radians.
function* readings() {
  for (const order of [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]]) {
    for (let bits = 0; bits < 8; bits++) {
      const signs = [0, 1, 2].map((i) => (bits & (1 << i) ? -1 : 1));
      for (const scale of [Math.PI / 180, 1]) yield { order, signs, scale };
    }
  }
}

export const turned = ({ order, signs, scale }, rate) => order.map((from, i) => signs[i] * scale * rate[from]);

export class AxesTest {
  constructor() {
    this.rows = [];
    this.still = []; // index range of each pose held so far
    this.result = null;
    this.problem = null;
  }

  get pose() { return POSES[this.still.length] ?? null; }

  // One sample: t in s, acc with gravity in m/s², rate [alpha, beta, gamma] as the browser gives it. True when something changed.
  push(t, acc, rate) {
    if (!this.pose || this.problem) return false;
    if (![...acc, ...rate].every(Number.isFinite)) return this.fail(speak`This device provides no angular rate, so it cannot be used as a sensor.`);
    this.rows.push({ t, acc, rate });
    let from = this.rows.length - 1;
    while (from > 0 && t - this.rows[from - 1].t <= STILL_S) from--;
    if (t - this.rows[0].t < STILL_S || from <= (this.still.at(-1)?.to ?? -1)) return false;
    const late = this.rows.slice(from);
    const middle = mean(late, "acc"), norm = length(middle);
    if (late.some((row) => length(row.acc.map((v, i) => v - middle[i])) > STILL_SPREAD)) return false;
    if (Math.abs(norm - GRAVITY) > OFF) {
      return this.fail(speak`At rest it measures ${fixed(norm, 1)} m/s² instead of 9.8; its acceleration excludes gravity.`);
    }
    if (Math.abs(middle[this.pose.axis]) < ALONG * norm) return false;
    this.still.push({ from, to: this.rows.length - 1, acc: middle, rate: mean(late, "rate") });
    if (!this.pose) this.decide();
    return true;
  }

  fail(words) {
    this.problem = words;
    return true;
  }

  decide() {
    const signs = this.still.map(({ acc }, i) => Math.sign(acc[POSES[i].axis]));
    if (signs.some((s) => s !== signs[0])) {
      return this.fail(speak`One edge was reversed: expected the left long edge down, then the top edge up.`);
    }
    const rest = mean(this.still, "rate"); // what the rates show in rest is their offset
    const found = [...readings()].map((reading) => ({ ...reading, error: this.misfit(reading, rest) }));
    found.sort((a, b) => a.error - b.error);
    const [best, next] = found;
    if (best.error > FITS_DEG || next.error < OTHERS_DEG) {
      const off = best.error <= 180 ? speak` (${Math.round(best.error)}° off)` : "";
      return this.fail(speak`The rotations do not match gravity${off}. Turn the device directly from one position to the next, without hurrying.`);
    }
    this.result = { accSign: signs[0], order: best.order, signs: best.signs, scale: best.scale, errorDeg: best.error };
    return true;
  }

  // Largest angle, over the three turns, between gravity turned along and gravity measured.
  misfit(reading, rest) {
    let worst = 0;
    for (let k = 1; k < this.still.length; k++) {
      let g = this.still[k - 1].acc, turning = 0;
      if (angleDeg(g, this.still[k].acc) < TURN_DEG) return Infinity;
      for (let i = this.still[k - 1].to + 1; i <= this.still[k].to; i++) {
        const dt = this.rows[i].t - this.rows[i - 1].t;
        const w = turned(reading, this.rows[i].rate.map((v, j) => v - rest[j]));
        turning += length(w) * dt;
        if (turning > MOST_TURNING) return Infinity;
        g = turn(g, w.map((v) => -v * dt));
      }
      worst = Math.max(worst, angleDeg(g, this.still[k].acc));
    }
    return worst;
  }
}

// Rodrigues' rotation of v by the rotation vector r.
function turn(v, r) {
  const angle = length(r);
  if (angle < 1e-12) return v;
  const k = r.map((x) => x / angle), c = Math.cos(angle), s = Math.sin(angle);
  const cross = [k[1] * v[2] - k[2] * v[1], k[2] * v[0] - k[0] * v[2], k[0] * v[1] - k[1] * v[0]];
  return v.map((x, i) => x * c + cross[i] * s + k[i] * dot(k, v) * (1 - c));
}
