// The sensors of one take: where they come from and where each is worn.
import { suggest } from "./mapping.js";
import { DeviceMotion } from "./sources/device_motion.js";
import { Dot } from "./sources/dot.js";
import { Replay } from "./sources/replay.js";
import { NOT_THOSE } from "./words.js";
import { speak } from "../common/words.js";

const SOURCES = { dot: Dot, device_motion: DeviceMotion, replay: Replay };

export class Worn {
  constructor(told) {
    this.told = told; // {onchange, onend, onbattery}
    this.source = null;
    this.remembered = {}; // id → segment of the clinic's last take, told with the pairing
  }

  get kind() { return this.source?.kind; }
  get sensors() { return this.source?.sensors ?? []; }

  take(kind) {
    this.source = new SOURCES[kind]({ ...this.told, onchange: () => this.changed() });
  }

  // One more sensor of this kind, after a tap; throws an Error with the sentence to show.
  async add(kind) {
    const before = this.source;
    if (this.kind !== kind) this.take(kind);
    try {
      await this.source.add();
    } finally {
      if (!this.sensors.length) this.source = before;
      this.changed();
    }
  }

  // Files take the place of other files only when they can be read.
  async read(files) {
    const before = this.source;
    this.take("replay");
    try {
      await this.source.choose(files);
    } catch (error) {
      this.source = before;
      throw error;
    }
  }

  async leave() {
    await this.source?.close();
    this.source = null;
    this.changed();
  }

  changed() {
    suggest(this.sensors, this.remembered);
    this.told.onchange();
  }

  // A segment carries one sensor: it leaves the one that had it.
  place(sensor, segment) {
    for (const other of this.sensors) if (segment && other.segment === segment) other.segment = null;
    sensor.segment = segment;
    this.told.onchange();
  }

  rows() {
    return this.sensors.map((sensor, i) => ({ number: i + 1, sensor, health: this.source.health(sensor) }));
  }

  // Those that are placed and send.
  ready() {
    const sends = ({ sensor, health }) => sensor.segment && health.kind !== "bad" && health.text !== speak`Check`;
    return this.rows().filter(sends).map(({ sensor }) => sensor);
  }

  // Sensors, order and rates as the hello of an interrupted take has them: the server takes no other.
  restore(hello) {
    const all = hello.streams.flatMap((s) => s.sensors.map((x) => ({ ...x, rateHz: s.rate_hz })));
    const place = (sensor) => all.findIndex((x) => x.id === sensor.id);
    if (this.kind !== "replay") this.sensors.sort((a, b) => Number(place(a) < 0) - Number(place(b) < 0) || place(a) - place(b));
    for (const sensor of this.sensors) {
      const known = all[place(sensor)];
      sensor.segment = known?.segment ?? null;
      if (known && this.kind !== "replay") sensor.rateHz = known.rateHz;
    }
    const streams = this.source.streams(Object.fromEntries(all.map((x) => [x.id, x.segment])));
    if (JSON.stringify(streams) !== JSON.stringify(hello.streams)) throw new Error(NOT_THOSE);
  }
}
