// The line to the server: newest state, feedback and frame, the last strides and cues, and whether they are fresh.
// It comes back by itself; the server then sends what was missed (state, feedback, frame, last strides and cues).
const RETRY_MS = [250, 500, 1000, 2000, 5000];
export const STALE_MS = 500; // live feedback pauses when data are older (docs/science/feedback.md)
const CHECK_MS = 100;
const KEPT = 60; // strides and cues kept of each; the strip shows 20

export class Feed extends EventTarget {
  clock = null;
  timer = null;

  constructor(path) {
    super();
    this.path = path;
    this.tries = 0;
    this.strides = [];
    this.cues = [];
    this.fresh = null; // null = no frame yet
    this.line = "connecting";
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}${this.path}`);
    this.socket.onopen = () => { this.tries = 0; this.#line("open"); };
    this.socket.onmessage = (e) => this.#receive(JSON.parse(e.data));
    this.socket.onclose = (e) => this.#closed(e);
    this.clock ??= setInterval(() => this.#check(), CHECK_MS);
  }

  close() {
    this.ended = true;
    clearInterval(this.clock);
    clearTimeout(this.timer);
    this.socket?.close();
  }

  get age() {
    return this.seen === undefined ? Infinity : performance.now() - this.seen;
  }

  #line(line) {
    if (this.line === line) return;
    this.line = line;
    this.dispatchEvent(new CustomEvent("line", { detail: line }));
  }

  #closed(e) {
    if (this.ended) return;
    if (e.code === 1008) { // signed out, or outside the care team now: trying again would not help
      this.#line(e.reason === "not_found" ? "hidden" : "refused");
      return;
    }
    this.#line("lost");
    this.timer = setTimeout(() => this.open(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
  }

  #receive(message) {
    const { type } = message;
    if (type === "frame") {
      this.seen = performance.now();
      this.frame = message;
      this.delay = this.#delay(message);
      this.#check();
    } else if (type === "stride") keep(this.strides, message);
    else if (type === "cue") keep(this.cues, message);
    else if (type === "state") {
      if (this.state && this.state.take !== message.take) this.#forget();
      this.state = message;
    } else if (type === "feedback") this.feedback = message;
    this.dispatchEvent(new CustomEvent(type, { detail: message }));
  }

  // Another take begins with nothing of the one before.
  #forget() {
    this.strides.length = this.cues.length = 0;
    this.frame = this.seen = this.feedback = this.fastest = undefined;
    this.fresh = null;
  }

  // Sample to screen: what the server measured, and how much longer this frame was on its way here than the fastest.
  // A slow device would otherwise show the past as now.
  #delay({ t, delay_ms: delay }) {
    if (delay === null || delay === undefined) return null;
    const way = this.seen - 1000 * t - delay;
    this.fastest = Math.min(this.fastest ?? way, way);
    return delay + way - this.fastest;
  }

  #check() {
    const fresh = this.seen === undefined ? null : this.age <= STALE_MS && !this.frame.stale && (this.delay ?? 0) <= STALE_MS;
    if (fresh === this.fresh) return;
    this.fresh = fresh;
    this.dispatchEvent(new CustomEvent("fresh", { detail: fresh }));
  }
}

// A reconnected line sends the last strides again: the same stride replaces itself.
function keep(list, item) {
  const same = list.findIndex((x) => x.n === item.n && x.side === item.side);
  if (same >= 0) list[same] = item;
  else list.push(item);
  if (list.length > KEPT) list.splice(0, list.length - KEPT);
}
