// A Bluetooth with two Movella DOTs, as far as the page uses one (Web Bluetooth; XD0506P for what the sensors answer).
(() => {
  const uuid = (short) => `1517${short.toString(16)}-4947-11e9-8646-d663bd873d93`;
  const view = (bytes) => new DataView(Uint8Array.from(bytes).buffer);
  // acceleration 0.1, −0.2, 9.8 m/s² and 1, 2, −3 °/s, after the clock, little endian
  const RATE = [0xcd, 0xcc, 0xcc, 0x3d, 0xcd, 0xcc, 0x4c, 0xbe, 0xcd, 0xcc, 0x1c, 0x41, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0x40, 0xc0];

  class Characteristic extends EventTarget {
    constructor(read, write) {
      super();
      Object.assign(this, { read, write, listening: false });
    }
    async readValue() { return view(this.read()); }
    async writeValue(value) { this.write?.([...value]); }
    async startNotifications() { this.listening = true; return this; }
    say(bytes) {
      this.value = view(bytes);
      if (this.listening) this.oncharacteristicvaluechanged?.({ target: this });
    }
  }

  class Device extends EventTarget {
    constructor(number, tag) {
      super();
      Object.assign(this, { id: `browser-${number}`, name: "Movella DOT", reachable: true, on: false });
      // shortly before its clock starts again at 0
      this.began = performance.now() - (2 ** 32 - 4e6) / 1000;
      const name = [...new TextEncoder().encode(tag)];
      const settings = [0, 0, 0, 0, 0, 0, 0, name.length, ...name, ...Array(16 - name.length).fill(0), 60, 0, 0, 0, 0, 0, 0, 0];
      this.services = {
        [uuid(0x1000)]: {
          [uuid(0x1001)]: new Characteristic(() => [number, 1, 0, 0xcd, 0x22, 0xd4, ...Array(28).fill(0)]),
          [uuid(0x1002)]: new Characteristic(() => settings),
        },
        [uuid(0x2000)]: {
          [uuid(0x2001)]: new Characteristic(() => [1, 0, 0], (order) => { radio.orders.push(order); this.on = order[1] === 1; }),
          [uuid(0x2003)]: new Characteristic(() => []),
        },
        [uuid(0x3000)]: { [uuid(0x3001)]: new Characteristic(() => [80 + number, 0]) },
      };
      this.ticks = 0;
      this.gatt = { connect: () => this.connect(), disconnect: () => { this.on = false; } };
      setInterval(() => this.tick(), 7);
    }
    async connect() {
      if (!this.reachable) throw new Error("out of range");
      const found = (all, name) => { if (!all[name]) throw new Error(`no ${name}`); return all[name]; };
      return { getPrimaryService: async (name) => ({ getCharacteristic: async (c) => found(found(this.services, name), c) }) };
    }
    // samples of every 16667 µs; the radio gives them when it comes to it
    tick() {
      const due = Math.floor(((performance.now() - this.began) * 1000) / 16667);
      for (; this.ticks < due; this.ticks++) {
        if (due - this.ticks > 60 || !this.on || !this.reachable) continue;
        const t = (this.ticks * 16667) % 2 ** 32;
        this.services[uuid(0x2000)][uuid(0x2003)].say([t & 255, (t >>> 8) & 255, (t >>> 16) & 255, (t >>> 24) & 255, ...RATE]);
      }
    }
  }

  window.radio = {
    orders: [],
    devices: [new Device(1, "L_shank"), new Device(2, "R_shank")],
    next: 0,
    lose(i) { this.devices[i].reachable = false; this.devices[i].dispatchEvent(new Event("gattserverdisconnected")); },
    find(i) { this.devices[i].reachable = true; },
    turn() { this.devices.reverse(); },
  };
  Object.defineProperty(navigator, "bluetooth", { value: { requestDevice: async () => radio.devices[radio.next++ % 2] } });
})();
