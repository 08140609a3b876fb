// The stretch of time that the timeline shows; every lane draws the same.
const LEAST_S = 0.4;

export class TimeWindow extends EventTarget {
  constructor(duration) {
    super();
    this.duration = Math.max(duration, LEAST_S);
    this.start = 0;
    this.end = this.duration;
  }

  get span() {
    return this.end - this.start;
  }

  // 0 at the left edge, 1 at the right.
  place(t) {
    return (t - this.start) / this.span;
  }

  set(start, end) {
    const span = Math.min(Math.max(end - start, LEAST_S), this.duration);
    const from = Math.min(Math.max(start, 0), this.duration - span);
    if (from === this.start && from + span === this.end) return;
    this.start = from;
    this.end = from + span;
    this.dispatchEvent(new Event("move"));
  }

  // By a factor, around a moment that stays where it is on the screen.
  zoom(factor, around = (this.start + this.end) / 2) {
    const span = Math.min(Math.max(this.span * factor, LEAST_S), this.duration);
    const start = around - this.place(around) * span;
    this.set(start, start + span);
  }

  pan(by) {
    this.set(this.start + by, this.end + by);
  }

  whole() {
    this.set(0, this.duration);
  }

  // Bring a stretch into view, moving no more than needed.
  reveal(start, end = start) {
    if (start >= this.start && end <= this.end) return;
    const middle = (start + end) / 2;
    const span = Math.max(this.span, (end - start) * 1.5);
    this.set(middle - span / 2, middle + span / 2);
  }
}
