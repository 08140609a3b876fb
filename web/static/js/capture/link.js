// The tablet's socket (docs/reference/live-protocol.md): says hello, sends what the outbox holds from where the server stands,
// lets go of what is acknowledged, and connects again with growing pauses until the take is finished.
import { PROTOCOL } from "../common/wire.js";
import { fixed, plural, speak } from "../common/words.js";

const PAUSES_S = [0.25, 0.5, 1, 2, 4, 8];
const SILENCE_MS = 4000; // a network that is gone is noticed by missing acknowledgements, long before the browser says so
const READ_AT_ONCE = 32;
const LATE_S = 1; // signal made while the end was on its way is no loss
// Closed so, trying again would fail the same way.
const FINAL = { 1009: "refused", 4400: "refused", 4401: "token", 4410: "ended", 4412: "replaced" };

export class Link {
  /**
   * @param {import("./outbox.js").Outbox} outbox
   * @param {{ onchange?: (state: string) => void, onmessage?: (message: object) => void }} [listeners]
   */
  constructor(outbox, { onchange = () => {}, onmessage = () => {} } = {}) {
    this.outbox = outbox;
    this.onchange = onchange;
    this.onmessage = onmessage;
    this.state = "connecting"; // open, waiting (for the next try), finished, refused
    this.problem = null; // {code, detail} that ended it
    this.tries = 0;
    this.offlineSince = performance.now();
    this.wanted = true;
    this.window = 0;
    this.sent = this.floor = 0;
    outbox.onstored = () => this.pump();
    this.awake = () => this.state === "waiting" && this.connect();
    addEventListener("online", this.awake);
    this.watch = setInterval(() => this.check(), 500);
    this.connect();
  }

  url() {
    const url = new URL(this.outbox.record.socket, location.href);
    url.protocol = url.protocol.replace("http", "ws");
    return url;
  }

  connect() {
    clearTimeout(this.timer);
    if (!this.wanted) return;
    this.set("connecting");
    const { hello, token } = this.outbox.record;
    const socket = new WebSocket(this.url(), PROTOCOL);
    this.socket = socket;
    this.heard = performance.now();
    this.finishSent = false;
    socket.onopen = () => socket.send(JSON.stringify({ ...hello, token }));
    socket.onmessage = ({ data }) => socket === this.socket && this.receive(JSON.parse(data));
    socket.onclose = ({ code, reason }) => socket === this.socket && this.lost(code, reason);
  }

  receive(message) {
    this.heard = performance.now();
    if (message.type === "welcome") {
      if (message.next_seq < this.outbox.acked) return this.lose(message.next_seq);
      this.tries = 0;
      this.said = null;
      this.window = message.max_unacked;
      this.outbox.resumeAt(message.next_seq);
      // the last one again: the answer is how far the server's disk is, which this tablet may not have heard
      this.sent = this.floor = Math.max(this.outbox.acked, message.next_seq - 1);
      this.set("open");
      if (this.battery) this.tellBattery(this.battery);
      this.pump();
    } else if (message.type === "ack") {
      // what the server still holds from before the cut may be acknowledged after it
      this.sent = Math.max(this.sent, message.ack);
      this.outbox.acknowledge(message.ack);
      this.pump();
    } else if (message.type === "finished") {
      this.marked = Boolean(message.problem); // kept although count or hash did not fit
      // ended on the clinic's screen while this tablet still held something
      if (this.outbox.heldS > LATE_S) this.problem = { code: "ended", detail: "" };
      this.end(this.problem ? "refused" : "finished");
    } else if (message.type === "error") {
      this.said = { code: message.code, detail: message.detail };
      if (message.code === "finish_mismatch") this.resend(message);
      this.onchange(this.state);
    } else {
      this.onmessage(message);
    }
  }

  // Only one pump runs; it sends while the server lets it and there is something on this tablet's disk.
  async pump() {
    if (this.pumping) return;
    this.pumping = true;
    try {
      for (;;) {
        const socket = this.socket;
        const { acked, stored } = this.outbox;
        const most = acked < this.floor ? this.floor + 1 : acked + this.window; // what is on the server's disk is asked first
        const to = Math.min(stored, most, this.sent + READ_AT_ONCE);
        if (this.state !== "open" || this.sent >= to) break;
        const batches = await this.outbox.read(this.sent, to);
        if (socket !== this.socket || this.state !== "open") continue;
        if (!batches.length) break;
        for (const bytes of batches) socket.send(bytes);
        this.sent += batches.length;
      }
      this.finish();
    } finally {
      this.pumping = false;
    }
  }

  // After the last batch is acknowledged: say how many there were and what they hash to.
  finish() {
    const { stopped } = this.outbox.record;
    if (!stopped || this.finishSent || this.state !== "open" || this.outbox.writing || this.outbox.acked < this.outbox.made) return;
    this.finishSent = true;
    this.socket.send(JSON.stringify({ type: "finish", count: this.outbox.made, sha256: this.outbox.sha256() }));
  }

  lose(next) {
    this.problem = { code: "lost", detail: plural(this.outbox.acked, speak`It had acknowledged 1 batch and holds ${next}.`, speak`It had acknowledged ${this.outbox.acked} batches and holds ${next}.`) };
    this.end("refused");
  }

  // The server counts fewer batches than this tablet: give it the rest, if it is still here.
  resend({ code, detail, next_seq: next }) {
    if (!(next >= this.outbox.acked)) {
      this.problem = { code, detail };
      this.end("refused");
      return;
    }
    this.sent = this.floor = next;
    this.finishSent = false;
    this.pump();
  }

  tellBattery(sensors) {
    this.battery = sensors;
    if (this.state === "open") this.socket.send(JSON.stringify({ type: "battery", sensors }));
  }

  // Acknowledgements come at least every 250 ms while something is under way.
  check() {
    const owed = this.sent > this.outbox.acked || this.finishSent;
    if (this.state === "waiting" || (this.state === "open" && !owed)) this.heard = performance.now();
    if (performance.now() - this.heard <= SILENCE_MS) return;
    this.socket.onclose = null;
    this.socket.close();
    this.lost(1006, "");
  }

  lost(code, reason) {
    if (!this.wanted) return;
    if (code in FINAL) {
      this.problem = { code: FINAL[code], detail: this.said?.detail || reason || "" };
      this.end("refused");
      return;
    }
    const pause = PAUSES_S[Math.min(this.tries++, PAUSES_S.length - 1)] * (0.8 + 0.4 * Math.random());
    this.set("waiting");
    this.timer = setTimeout(() => this.connect(), pause * 1000);
  }

  // Go without a word; another link or none takes its place.
  leave() {
    this.onchange = () => {};
    this.end("refused");
  }

  end(state) {
    this.wanted = false;
    clearTimeout(this.timer);
    clearInterval(this.watch);
    removeEventListener("online", this.awake);
    const socket = this.socket;
    this.socket = null;
    socket?.close(1000);
    this.set(state);
  }

  set(state) {
    if (state === "open") this.offlineSince = null;
    else this.offlineSince ??= performance.now();
    this.state = state;
    this.onchange(state);
  }

  // For people: connected, buffering so many seconds, or lost.
  words() {
    const held = this.outbox.heldS;
    const away = this.offlineSince === null ? 0 : (performance.now() - this.offlineSince) / 1000;
    const seconds = `${held < 10 ? fixed(held, 1) : Math.round(held)} s`;
    if (this.state === "finished") return { kind: "ok", text: speak`On the server` };
    if (this.state === "refused") return { kind: "bad", text: speak`Not connected` };
    if (away > 10) return { kind: "bad", text: speak`No connection, ${seconds} stored here` };
    if (this.state !== "open") return held > 0.5 ? { kind: "warn", text: speak`Storing ${seconds} here` } : { kind: "run", text: speak`Connecting` };
    return held > 2 ? { kind: "run", text: speak`Sending ${seconds}` } : { kind: "ok", text: speak`Connected` };
  }
}
