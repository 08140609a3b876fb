// Recorded files played at the speed they were recorded, as if their sensors were worn now.
import { readFiles } from "./files.js";
import { RateMeter } from "./rate.js";
import { speak } from "../../common/words.js";

const TICK_MS = 20;
const BATCH_S = 0.05;
const ROUNDING_US = 1;
const JITTER_US = 60; // times off the rate's grid by more travel with each sample

export class Replay {
  kind = "replay";

  constructor({ onchange = () => {}, onend = () => {}, speed = 1 } = {}) {
    this.onchange = onchange;
    this.onend = onend;
    this.speed = speed;
    this.sensors = [];
    this.files = [];
    this.copies = [];
  }

  // Read the files; throws an Error with the sentence to show, and then nothing is changed.
  async choose(files) {
    const { tracks, segments, copies } = await readFiles(files);
    this.files = [...files];
    this.tracks = tracks;
    this.copies = copies;
    this.sensors = tracks.flatMap((track) => track.ids.map((id, i) => ({
      id, segment: segments[id] ?? null, rateHz: track.rateHz, meter: new RateMeter(),
      accRange: track.sensors?.[i].acc_range ?? null, gyrRange: track.sensors?.[i].gyr_range ?? null,
    })));
    this.durationS = Math.max(...tracks.map((t) => (t.tUs.at(-1) - t.tUs[0]) / 1e6));
    this.onchange();
  }

  saved() { return { files: this.files }; }

  // What the hello says of the worn ones; fixes which samples go out.
  streams(segments) {
    this.playing = this.tracks
      .map((track) => ({ track, worn: track.ids.flatMap((id, i) => (segments[id] ? [i] : [])), row: 0 }))
      .filter(({ worn }) => worn.length);
    return this.playing.map(({ track, worn }, stream) => ({
      stream, rate_hz: track.rateHz, clock: track.clock,
      sensors: worn.map((i) => {
        const { id, accRange, gyrRange } = this.sensors.find((s) => s.id === track.ids[i]);
        return { id, segment: segments[id], acc_range: accRange, gyr_range: gyrRange };
      }),
    }));
  }

  // lastUs: per stream the last sample already given, after a reload.
  start(onBatch, lastUs = {}) {
    for (const [stream, play] of this.playing.entries()) {
      const last = lastUs[stream] ?? -Infinity;
      while (play.row < play.track.tUs.length && play.track.tUs[play.row] <= last + ROUNDING_US) play.row++;
    }
    const next = this.playing.filter((p) => p.row < p.track.tUs.length).map((p) => p.track.tUs[p.row] + (p.track.lagUs ?? 0));
    this.zeroUs = Math.min(...next);
    this.began = performance.now();
    this.timer = setInterval(() => this.play(onBatch), TICK_MS);
    this.onchange();
  }

  play(onBatch) {
    const dueUs = this.zeroUs + (performance.now() - this.began) * 1000 * this.speed;
    for (const [stream, play] of this.playing.entries()) {
      const { track } = play;
      const most = Math.max(1, Math.round(track.rateHz * BATCH_S));
      for (;;) {
        const end = this.cut(play, most);
        // a batch goes when its last sample has happened
        if (end === play.row || track.tUs[end - 1] + (track.lagUs ?? 0) > dueUs) break;
        onBatch(this.batch(stream, play, end), track.rateHz);
        play.row = end;
      }
    }
    if (this.playing.every(({ row, track }) => row >= track.tUs.length)) {
      this.stop();
      this.onend();
    }
  }

  // Lost packets end a batch, so that what follows keeps its own time.
  cut({ track, row }, most) {
    let end = row;
    const step = 1.5e6 / track.rateHz;
    while (end < track.tUs.length && end - row < most && (end === row || track.tUs[end] - track.tUs[end - 1] < step)) end++;
    return end;
  }

  batch(stream, { track, worn, row }, end) {
    const samples = new Float32Array((end - row) * worn.length * 9);
    const t0 = Math.round(track.tUs[row]);
    let jitter = 0;
    for (let i = row; i < end; i++) {
      worn.forEach((s, place) => samples.set(track.values[s].subarray(i * 9, i * 9 + 9), ((i - row) * worn.length + place) * 9));
      jitter = Math.max(jitter, Math.abs(track.tUs[i] - t0 - ((i - row) * 1e6) / track.rateHz));
    }
    for (const s of worn) this.sensors.find((one) => one.id === track.ids[s]).meter.push(end - row);
    const offsetsUs = jitter > JITTER_US ? Uint32Array.from(track.tUs.subarray(row, end), (t) => Math.round(t) - t0) : null;
    return { stream, t0Us: t0, nImu: worn.length, samples, offsetsUs };
  }

  stop() {
    clearInterval(this.timer);
    this.timer = null;
  }

  close() { this.stop(); }

  health(sensor) {
    if (!this.timer) return { kind: "ok", text: speak`Ready`, rateHz: sensor.rateHz };
    return { kind: "ok", text: speak`Playing`, rateHz: sensor.meter.rateHz() };
  }
}
