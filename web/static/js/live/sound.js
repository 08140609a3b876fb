// Sound by Web Audio: a tone with pitch and level by the error, a tick at each contact. Browsers allow it after a tap.
const TONE_S = 0.25;
const TICK_S = 0.04;
const RAMP_S = 0.012; // soft edges, so that nothing clicks that is not a tick
const TICK_HZ = { left: 880, right: 660 }; // the two feet sound a fourth apart, so that they can be told

export class Sound {
  /** @type {AudioContext | undefined} */
  context;

  constructor() {
    this.on = false;
    this.volume = 0.5;
  }

  // Called by a tap: makes the context at the first one, wakes it up at the next.
  async start() {
    this.context ??= new AudioContext({ latencyHint: "interactive" });
    if (this.context.state === "suspended") await this.context.resume();
    this.on = this.context.state === "running";
    return this.on;
  }

  stop() { this.on = false; }

  tone({ pitch, level }) { this.#play("sine", pitch, level, TONE_S); }
  tick(side) { this.#play("triangle", TICK_HZ[side] ?? TICK_HZ.left, 0.8, TICK_S); }

  #play(shape, hertz, level, seconds) {
    if (!this.on || this.context.state !== "running") return;
    const from = this.context.currentTime, to = from + seconds;
    const source = this.context.createOscillator(), gain = this.context.createGain();
    source.type = shape;
    source.frequency.value = hertz;
    const loud = Math.max(0, Math.min(1, level)) * this.volume;
    gain.gain.setValueAtTime(0, from);
    gain.gain.linearRampToValueAtTime(loud, from + RAMP_S);
    gain.gain.setValueAtTime(loud, Math.max(from + RAMP_S, to - RAMP_S));
    gain.gain.linearRampToValueAtTime(0, to);
    source.connect(gain).connect(this.context.destination);
    source.start(from);
    source.stop(to);
  }
}
