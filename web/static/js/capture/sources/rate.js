// How many samples a second came of late, and for how long nothing has.
const WINDOW_MS = 2000;

export class RateMeter {
  constructor() {
    this.marks = [];
    this.last = null;
  }

  push(samples, now = performance.now()) {
    this.last = now;
    this.marks.push([now, samples]);
    while (this.marks[0][0] < now - WINDOW_MS) this.marks.shift();
  }

  rateHz(now = performance.now()) {
    const recent = this.marks.filter(([at]) => at >= now - WINDOW_MS);
    if (recent.length < 2) return 0;
    const span = recent.at(-1)[0] - recent[0][0];
    // the first mark opens the span, its own samples lie before it
    return span > 0 ? (recent.slice(1).reduce((sum, [, n]) => sum + n, 0) * 1000) / span : 0;
  }

  silentS(now = performance.now()) {
    return this.last === null ? null : (now - this.last) / 1000;
  }
}
