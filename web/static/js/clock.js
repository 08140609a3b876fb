// The one clock of a session page: 3D figure, charts, stride strip and time bar all follow it.
const read = () => {
  const el = document.getElementById("replay-data");
  return el ? JSON.parse(el.textContent) : { duration_s: 0, strides: [], curves: {} };
};

// Where a drawing stands for the figure, what asks for sizes and loads 3D waits until that is seen; a page that nobody
// looks at paints nothing.
if (document.querySelector("[data-first]") && !document.hidden) await new Promise((done) => { requestAnimationFrame(() => setTimeout(done)); });

class Clock extends EventTarget {
  constructor(data) {
    super();
    this.duration = data.duration_s;
    this.called = data.called ?? "stride"; // what the strides are: of squats each is one squat
    // {side, start_s, end_s, used}; on the overview, which must be light, a row of the four
    this.strides = data.strides.map((s) => (Array.isArray(s) ? { side: s[0], start_s: s[1], end_s: s[2], used: Boolean(s[3]) } : s));
    this.curves = data.curves; // variable → {left, right}: mean at 0…100 %, degrees
    this.stride = this.strides.find((s) => s.used) ?? this.strides[0] ?? null;
    this.t = this.stride ? this.stride.start_s : 0;
    this.playing = false;
    this.speed = 1;
  }

  // Position in the current stride, % of cycle; null outside every stride (standing, turning without strides).
  get percent() {
    const s = this.stride;
    if (!s || this.t < s.start_s || this.t > s.end_s) return null;
    return (100 * (this.t - s.start_s)) / (s.end_s - s.start_s);
  }

  // Another stride list, as a correction gives it. The stride that was picked, known by its middle, stays picked, also
  // when its contact is moved past the moment that is shown; the moment then goes with it.
  load(strides) {
    const before = this.stride;
    const middle = before ? (before.start_s + before.end_s) / 2 : NaN;
    const same = strides.find((s) => s.side === before?.side && middle >= s.start_s && middle < s.end_s);
    if (same && this.t >= before.start_s && this.t < same.start_s) this.t = same.start_s;
    this.strides = strides;
    this.stride = same ?? this.at(this.t) ?? strides.find((s) => s.start_s >= this.t) ?? strides.at(-1) ?? null;
    this.dispatchEvent(new Event("tick"));
  }

  at(t, side = this.stride?.side) {
    const inside = this.strides.filter((s) => t >= s.start_s && t < s.end_s);
    return inside.find((s) => s.side === side) ?? inside[0] ?? null;
  }

  set(t) {
    this.t = Math.min(Math.max(t, 0), this.duration);
    const s = this.stride;
    if (!s || this.t < s.start_s || this.t >= s.end_s) this.stride = this.at(this.t) ?? s;
    this.dispatchEvent(new Event("tick"));
  }

  // Another moment while the stride that was picked stays picked.
  look(t, stride = this.stride) {
    this.t = Math.min(Math.max(t, 0), this.duration);
    this.stride = stride;
    this.dispatchEvent(new Event("tick"));
  }

  setPercent(p) {
    const s = this.stride;
    if (!s) return;
    this.t = s.start_s + (Math.min(Math.max(p, 0), 100) / 100) * (s.end_s - s.start_s);
    this.dispatchEvent(new Event("tick"));
  }

  pick(stride) {
    this.stride = stride;
    this.t = stride.start_s;
    this.dispatchEvent(new Event("tick"));
  }

  // Next or previous used stride in time, either side.
  step(direction) {
    const used = this.strides.filter((s) => s.used).sort((a, b) => a.start_s - b.start_s);
    if (!used.length) return;
    const i = used.indexOf(this.stride);
    this.pick(used[Math.min(Math.max(i + direction, 0), used.length - 1)]);
  }

  toggle() {
    this.playing = !this.playing;
    if (this.playing) {
      if (this.t >= this.duration - 0.01) this.set(0);
      let last = performance.now();
      const frame = (now) => {
        if (!this.playing) return;
        const next = this.t + (this.speed * (now - last)) / 1000;
        last = now;
        if (next >= this.duration) this.playing = false;
        this.set(next);
        if (this.playing) requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }
    this.dispatchEvent(new Event("tick"));
  }
}

export const clock = new Clock(read());

// J/K next and previous stride, arrows 1 % of the cycle, P play; never while typing.
document.addEventListener("keydown", (e) => {
  if (e.ctrlKey || e.metaKey || e.altKey || e.target.closest("input,select,textarea,dialog,[contenteditable]")) return;
  const acts = {
    j: () => clock.step(1),
    k: () => clock.step(-1),
    p: () => clock.toggle(),
    ArrowRight: () => clock.setPercent((clock.percent ?? -1) + 1),
    ArrowLeft: () => clock.setPercent((clock.percent ?? 1) - 1),
  };
  const act = acts[e.key];
  if (!act || !clock.strides.length) return;
  e.preventDefault();
  act();
});
