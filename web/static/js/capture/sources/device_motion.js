// The device's own sensor (DeviceMotion): one stream, one sensor, a time with every sample.
import { AxesTest, turned } from "./axes.js";
import { RateMeter } from "./rate.js";
import { speak } from "../../common/words.js";

const BATCH_S = 0.05;
const SILENT_S = 1, MUTE_S = 5;
const ID_KEY = "sagittal.capture.device", AXES_KEY = "sagittal.capture.axes";

export function whyNot() {
  if (!isSecureContext) return speak`The built-in sensor requires https. Open this page at the server's https address.`;
  if (!("DeviceMotionEvent" in window)) return speak`This browser does not allow pages to use the motion sensor.`;
  return null;
}

const remembered = (key) => {
  try { return JSON.parse(localStorage.getItem(key)); } catch { return null; }
};
const remember = (key, value) => {
  try { localStorage.setItem(key, JSON.stringify(value)); } catch { /* storage refused: ask again next time */ }
};

export class DeviceMotion {
  kind = "device_motion";

  constructor({ onchange = () => {} } = {}) {
    this.onchange = onchange;
    this.sensors = [];
    this.test = null;
    this.onBatch = null;
    this.hear = (event) => this.take(event);
  }

  // Ask (iOS wants a tap for it) and listen; the axes are checked once per browser version.
  async add() {
    const motion = /** @type {any} */ (DeviceMotionEvent); // only iOS has to be asked
    if (motion.requestPermission && (await motion.requestPermission()) !== "granted") {
      throw new Error(speak`Motion sensor access was denied. Reload this page and allow it, or allow it in the browser's settings.`);
    }
    let id = remembered(ID_KEY);
    if (!id) remember(ID_KEY, (id = `device-${crypto.getRandomValues(new Uint32Array(1))[0].toString(16).padStart(8, "0")}`));
    this.sensors = [{ id, label: speak`This device`, segment: null, battery: null, rateHz: 60, meter: new RateMeter(), steps: [] }];
    const axes = remembered(AXES_KEY);
    this.axes = axes?.browser === navigator.userAgent ? axes : null;
    if (!this.axes) this.check();
    this.addedMs = performance.now();
    addEventListener("devicemotion", this.hear);
    this.onchange();
  }

  // Start the self-test (again).
  check() {
    this.axes = null;
    this.test = new AxesTest();
    this.onchange();
  }

  // It was listened to for some seconds and has said nothing: a computer without a motion sensor.
  isMute() { return this.sensors[0].meter.silentS() === null && performance.now() - this.addedMs > 1000 * MUTE_S; }

  take(event) {
    const a = event.accelerationIncludingGravity, r = event.rotationRate;
    if (!a || !r || a.x === null || r.alpha === null) return;
    const [sensor] = this.sensors;
    const acc = [a.x, a.y, a.z], rate = [r.alpha, r.beta, r.gamma];
    sensor.meter.push(1);
    this.measure(sensor, event.timeStamp);
    if (this.test) {
      if (this.test.push(event.timeStamp / 1000, acc, rate)) this.tested();
      return;
    }
    if (!this.onBatch) return;
    const tUs = (performance.timeOrigin + event.timeStamp) * 1000;
    if (tUs <= this.lastUs) return;
    this.lastUs = tUs;
    this.rows.push({ tUs, values: [...acc.map((v) => v * this.axes.accSign), ...turned(this.axes, rate), NaN, NaN, NaN] });
    if (this.rows.length >= Math.max(1, Math.round(sensor.rateHz * BATCH_S))) this.flush();
  }

  // The rate of the browser, from the times of its events; `interval` is rounded, and in seconds on some.
  measure(sensor, stamp) {
    if (this.onBatch) return; // fixed by the hello
    if (sensor.lastStamp < stamp) sensor.steps.push(stamp - sensor.lastStamp);
    sensor.lastStamp = stamp;
    if (sensor.steps.length < 30) return;
    if (sensor.steps.length > 200) sensor.steps.shift();
    sensor.rateHz = Math.round(1000 / [...sensor.steps].sort((x, y) => x - y)[sensor.steps.length >> 1]);
  }

  tested() {
    if (this.test.result) {
      this.axes = { ...this.test.result, browser: navigator.userAgent };
      remember(AXES_KEY, this.axes);
      this.test = null;
    }
    this.onchange();
  }

  flush() {
    const rows = this.rows;
    if (!rows.length) return;
    this.rows = [];
    const t0Us = Math.round(rows[0].tUs);
    const offsetsUs = Uint32Array.from(rows, (row) => Math.round(row.tUs) - t0Us);
    this.onBatch({ stream: 0, t0Us, nImu: 1, samples: Float32Array.from(rows.flatMap((r) => r.values)), offsetsUs }, this.sensors[0].rateHz);
  }

  saved() { return {}; }

  streams(segments) {
    const [{ id, rateHz }] = this.sensors;
    // the browser does not tell the ranges of its sensor
    return [{ stream: 0, rate_hz: rateHz, clock: "own", sensors: [{ id, segment: segments[id], acc_range: null, gyr_range: null }] }];
  }

  start(onBatch, lastUs = {}) {
    this.rows = [];
    this.lastUs = lastUs[0] ?? 0;
    this.onBatch = onBatch;
  }

  stop() {
    if (this.onBatch) this.flush();
    this.onBatch = null;
  }

  close() {
    this.stop();
    removeEventListener("devicemotion", this.hear);
    this.sensors = [];
  }

  health(sensor) {
    const silent = sensor.meter.silentS();
    const rateHz = sensor.meter.rateHz();
    if (silent === null || silent > SILENT_S) return { kind: "bad", text: speak`No data`, rateHz: 0, note: speak`this device sends no motion` };
    if (!this.axes) return { kind: "warn", text: speak`Check`, rateHz, note: speak`axes not checked yet` };
    if (rateHz < 40) return { kind: "bad", text: speak`Too slow`, rateHz, note: speak`at least 40 Hz required` };
    return { kind: "ok", text: speak`Ready`, rateHz };
  }
}
