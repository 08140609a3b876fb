// Movella DOT sensors over Web Bluetooth: each one a stream with a clock of its own.
import { BATTERY, CONTROL, Clock, DEVICE, INFO, MODES, SERVICES, address, control, decode, settings } from "./dot_payload.js";
import { RateMeter } from "./rate.js";
import { speak } from "../../common/words.js";

const MODE = 21; // acceleration and rate of turn: all the estimation needs, in the fewest bytes
const BATCH_S = 0.1;
const LOW_BATTERY = 25;
const SILENT_S = 2;
const PAUSES_MS = [500, 1000, 2000, 4000];
const SAME_CLOCK_US = 1e6; // after a reconnection the sensor's clock has gone on when it is this close to ours
const ACC_RANGE = 16 * 9.80665, GYR_RANGE = 2000 * (Math.PI / 180); // ±16 g and ±2000 °/s (Movella DOT data sheet)

// Why there is no Bluetooth here, in a sentence for people; null where there is.
export function whyNot() {
  if (navigator.bluetooth) return null;
  if (!isSecureContext) return speak`Bluetooth requires https. Open this page at the server's https address.`;
  return speak`This browser cannot reach Bluetooth sensors. Use Chrome or Edge on Android, Windows, macOS or ChromeOS;`
    + speak` on an iPad use a browser with Web Bluetooth, such as Bluefy.`;
}

const nowUs = () => (performance.timeOrigin + performance.now()) * 1000;

export class Dot {
  kind = "dot";

  /** @param {{ bluetooth?: any, onchange?: () => void, onbattery?: (levels: object) => void }} [options] */
  constructor({ bluetooth = navigator.bluetooth, onchange = () => {}, onbattery = () => {} } = {}) {
    this.bluetooth = bluetooth;
    this.onchange = onchange;
    this.onbattery = onbattery;
    this.sensors = [];
    this.onBatch = null;
  }

  // Ask for one sensor (needs a tap) and listen to it; throws an Error with the sentence to show.
  async add() {
    let device;
    try {
      device = await this.bluetooth.requestDevice({
        filters: [{ namePrefix: "Movella DOT" }, { namePrefix: "Xsens DOT" }],
        optionalServices: Object.values(SERVICES),
      });
    } catch (error) {
      if (error.name === "NotFoundError") return; // the person closed the list
      throw new Error(speak`Bluetooth did not respond (${error.message}). Turn on Bluetooth and allow it for this page.`);
    }
    if (this.sensors.some((s) => s.device === device)) return;
    const sensor = {
      device, id: device.id, label: device.name, segment: null, battery: null, rateHz: 60, meter: new RateMeter(),
      clock: new Clock(), rows: [], tries: 0, shiftUs: null,
    };
    device.addEventListener("gattserverdisconnected", () => this.again(sensor));
    try {
      await this.connect(sensor);
    } catch (error) {
      sensor.gone = true;
      device.gatt.disconnect();
      throw new Error(speak`${device.name} did not respond (${error.message}). Hold it close, move it to wake it, and try again.`);
    }
    this.sensors.push(sensor);
    this.onchange();
  }

  async connect(sensor) {
    const server = await sensor.device.gatt.connect();
    const configuration = await server.getPrimaryService(SERVICES.configuration);
    sensor.fresh = true;
    sensor.id = address(await (await configuration.getCharacteristic(INFO)).readValue());
    const { tag, rateHz } = settings(await (await configuration.getCharacteristic(DEVICE)).readValue());
    Object.assign(sensor, { label: tag || sensor.device.name, rateHz: rateHz || 60 });
    const measurement = await server.getPrimaryService(SERVICES.measurement);
    const payload = await measurement.getCharacteristic(MODES[MODE].by);
    payload.oncharacteristicvaluechanged = ({ target }) => this.take(sensor, target.value);
    await payload.startNotifications(); // before the start, or the first packets are lost
    sensor.control = await measurement.getCharacteristic(CONTROL);
    await sensor.control.writeValue(control(MODE, true));
    const battery = await (await server.getPrimaryService(SERVICES.battery)).getCharacteristic(BATTERY);
    const charge = (view) => {
      sensor.battery = view.getUint8(0);
      const known = this.sensors.filter((s) => s.battery !== null);
      this.onbattery(Object.fromEntries(known.map((s) => [s.id, s.battery])));
      this.onchange();
    };
    charge(await battery.readValue());
    battery.oncharacteristicvaluechanged = ({ target }) => charge(target.value);
    await battery.startNotifications();
    sensor.tries = 0;
  }

  again(sensor) {
    if (sensor.gone) return;
    const pause = PAUSES_MS[Math.min(sensor.tries++, PAUSES_MS.length - 1)];
    this.onchange();
    setTimeout(() => sensor.gone || this.connect(sensor).catch(() => this.again(sensor)), pause);
  }

  take(sensor, view) {
    const sample = decode(MODE, view);
    const now = performance.now();
    sensor.meter.push(1, now);
    const device = sensor.clock.read(sample.tUs);
    const here = nowUs();
    // The sensor's ticks, moved by a constant to this tablet's time so that they go on after a reload or reconnection.
    const restarted = sensor.fresh && Math.abs(device + sensor.shiftUs - here) > SAME_CLOCK_US;
    if (sensor.shiftUs === null || restarted) sensor.shiftUs = here - device;
    sensor.fresh = false;
    const tUs = Math.max(device + sensor.shiftUs, (sensor.lastUs ?? 0) + 1);
    if (!this.onBatch || sensor.stream === undefined) return;
    sensor.lastUs = tUs;
    sensor.rows.push({ tUs, values: [...sample.acc, ...sample.gyr, NaN, NaN, NaN] });
    if (sensor.rows.length >= Math.max(1, Math.round(sensor.rateHz * BATCH_S))) this.flush(sensor);
  }

  flush(sensor) {
    const { rows } = sensor;
    if (!rows.length) return;
    sensor.rows = [];
    const t0Us = Math.round(rows[0].tUs);
    const offsetsUs = Uint32Array.from(rows, (row) => Math.round(row.tUs) - t0Us);
    const samples = Float32Array.from(rows.flatMap((row) => row.values));
    this.onBatch({ stream: sensor.stream, t0Us, nImu: 1, samples, offsetsUs }, sensor.rateHz);
  }

  saved() { return {}; }

  streams(segments) {
    for (const sensor of this.sensors) sensor.stream = undefined;
    return this.sensors.filter((s) => segments[s.id]).map((sensor, stream) => {
      sensor.stream = stream;
      return {
        stream, rate_hz: sensor.rateHz, clock: "own",
        sensors: [{ id: sensor.id, segment: segments[sensor.id], acc_range: ACC_RANGE, gyr_range: GYR_RANGE }],
      };
    });
  }

  start(onBatch, lastUs = {}) {
    for (const sensor of this.sensors) sensor.lastUs = lastUs[sensor.stream];
    this.onBatch = onBatch;
  }

  // Give what is in hand; the sensors go on measuring for the next take.
  stop() {
    if (this.onBatch) for (const sensor of this.sensors) this.flush(sensor);
    this.onBatch = null;
  }

  async close() {
    this.stop();
    for (const sensor of this.sensors) {
      sensor.gone = true;
      await sensor.control?.writeValue(control(MODE, false)).catch(() => {}); // out of reach: it stops by itself
      sensor.device.gatt.disconnect();
    }
    this.sensors = [];
  }

  health(sensor) {
    const silent = sensor.meter.silentS();
    const rateHz = sensor.meter.rateHz();
    if (silent === null || silent > SILENT_S) {
      return { kind: "bad", text: speak`No data`, rateHz: 0, note: silent === null ? "" : speak`last seen ${Math.round(silent)} s ago` };
    }
    if (sensor.rateHz < 40) return { kind: "bad", text: speak`Too slow`, rateHz, note: speak`set 60 Hz in the Movella app` };
    if (rateHz < 0.9 * sensor.rateHz) return { kind: "warn", text: speak`Weak`, rateHz, note: speak`move it closer` };
    if (sensor.battery !== null && sensor.battery < LOW_BATTERY) return { kind: "warn", text: speak`Low`, rateHz, note: speak`charge it soon` };
    return { kind: "ok", text: speak`Ready`, rateHz };
  }
}
