// Movella DOT over Bluetooth: addresses and payloads (XD0506P, BLE Services Specifications rev F), little endian.
// Every payload starts with the sensor's clock, uint32 µs, which starts again at 0 after 71.6 min.
const uuid = (short) => `1517${short.toString(16).padStart(4, "0")}-4947-11e9-8646-d663bd873d93`;
export const SERVICES = { configuration: uuid(0x1000), measurement: uuid(0x2000), battery: uuid(0x3000) };
export const INFO = uuid(0x1001), DEVICE = uuid(0x1002), CONTROL = uuid(0x2001), BATTERY = uuid(0x3001);
const LONG = uuid(0x2002), MEDIUM = uuid(0x2003), SHORT = uuid(0x2004);

const WRAP_US = 2 ** 32;
const RADIANS = Math.PI / 180;
const MAG_SCALE = 2 ** -12; // three int16 fixed point numbers, Earth's field about 1

const FIELDS = { quat: 4, euler: 3, acc: 3, free_acc: 3, gyr: 3 };
// Mode → what follows the clock, and the characteristic it comes by.
export const MODES = {
  2: { fields: ["quat", "free_acc", "status", "clips"], by: MEDIUM }, // extended, quaternion
  3: { fields: ["quat", "free_acc"], by: MEDIUM }, // complete, quaternion
  4: { fields: ["euler"], by: SHORT },
  5: { fields: ["quat"], by: SHORT },
  6: { fields: ["free_acc"], by: SHORT },
  7: { fields: ["euler", "free_acc", "status", "clips"], by: MEDIUM }, // extended, Euler
  16: { fields: ["euler", "free_acc"], by: MEDIUM }, // complete, Euler
  20: { fields: ["acc", "gyr", "mag"], by: MEDIUM }, // rate quantities with magnetic field
  21: { fields: ["acc", "gyr"], by: MEDIUM }, // rate quantities
  22: { fields: ["euler", "free_acc", "gyr"], by: MEDIUM },
  24: { fields: ["quat", "gyr"], by: MEDIUM },
  26: { fields: ["quat", "acc", "gyr"], by: LONG },
};
const SIZE = { mag: 6, status: 2, clips: 2 };
const sizeOf = (mode) => MODES[mode].fields.reduce((sum, f) => sum + (SIZE[f] ?? FIELDS[f] * 4), 4);

// {tUs, acc m/s², gyr rad/s, mag a.u., quat w x y z, euler rad, free_acc m/s², status} as far as the mode has them.
export function decode(mode, view) {
  if (!(mode in MODES)) throw new RangeError(`payload mode ${mode} cannot be read; expected one of ${Object.keys(MODES).join(", ")}`);
  if (view.byteLength < sizeOf(mode)) throw new RangeError(`payload mode ${mode} has ${sizeOf(mode)} bytes, not ${view.byteLength}`);
  const out = { tUs: view.getUint32(0, true) };
  let at = 4;
  for (const field of MODES[mode].fields) {
    if (field === "mag") {
      out.mag = [0, 2, 4].map((i) => view.getInt16(at + i, true) * MAG_SCALE);
    } else if (field === "status") {
      out.status = view.getUint16(at, true); // bits 0x1 to 0x100: an axis beyond its range
    } else if (field === "clips") {
      out.clips = [view.getUint8(at), view.getUint8(at + 1)];
    } else {
      out[field] = Array.from({ length: FIELDS[field] }, (_, i) => view.getFloat32(at + i * 4, true));
      if (field === "gyr" || field === "euler") out[field] = out[field].map((v) => v * RADIANS);
    }
    at += SIZE[field] ?? FIELDS[field] * 4;
  }
  return out;
}

// start or stop of one mode, for the control characteristic
export const control = (mode, on) => Uint8Array.of(1, on ? 1 : 0, mode);

// Address and name a person gave it, from the two configuration characteristics.
export const address = (view) => [5, 4, 3, 2, 1, 0].map((i) => view.getUint8(i).toString(16).padStart(2, "0")).join("").toUpperCase();
export function settings(view) {
  const length = Math.min(view.getUint8(7), 16);
  const tag = new TextDecoder().decode(new Uint8Array(view.buffer, view.byteOffset + 8, length)).replace(/\0.*$/, "");
  return { tag, rateHz: view.getUint16(24, true) };
}

// The sensor's clock without its wraps.
export class Clock {
  read(tUs) {
    if (this.last !== undefined) {
      const step = (tUs - this.last + WRAP_US) % WRAP_US;
      this.total += step > WRAP_US / 2 ? step - WRAP_US : step; // a late packet goes back a little
    } else this.total = tUs;
    this.last = tUs;
    return this.total;
  }
}
