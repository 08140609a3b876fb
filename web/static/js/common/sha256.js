// SHA-256 (FIPS 180-4) that grows with a take and can be put away in between; crypto.subtle takes whole messages only,
// and is missing where the page comes over plain http.
const primes = [];
for (let n = 2; primes.length < 64; n++) if (primes.every((p) => n % p)) primes.push(n);
// fractional bits of square and cube roots of the primes; BigInt, as doubles are too short for the cube roots
const root = (n, power) => {
  const scaled = BigInt(n) << BigInt(32 * power);
  let low = 0n, high = 1n << 40n;
  while (high - low > 1n) {
    const middle = (low + high) / 2n;
    if (middle ** BigInt(power) <= scaled) low = middle;
    else high = middle;
  }
  return Number(low & 0xffffffffn);
};
const START = Uint32Array.from(primes.slice(0, 8), (p) => root(p, 2));
const K = Uint32Array.from(primes, (p) => root(p, 3));
const turn = (x, n) => (x >>> n) | (x << (32 - n));

export class Sha256 {
  constructor(saved = null) {
    this.words = Uint32Array.from(saved?.words ?? START);
    this.rest = Uint8Array.from(saved?.rest ?? []);
    this.length = saved?.length ?? 0;
    this.schedule = new Uint32Array(64);
  }

  // Plain values for IndexedDB, from which the constructor goes on.
  state() {
    return { words: this.words.slice(), rest: this.rest.slice(), length: this.length };
  }

  update(bytes) {
    this.length += bytes.length;
    let at = 0;
    if (this.rest.length) {
      at = Math.min(64 - this.rest.length, bytes.length);
      const joined = new Uint8Array(this.rest.length + at);
      joined.set(this.rest);
      joined.set(bytes.subarray(0, at), this.rest.length);
      this.rest = joined;
      if (joined.length < 64) return this;
      this.block(joined, 0);
    }
    for (; at + 64 <= bytes.length; at += 64) this.block(bytes, at);
    this.rest = bytes.slice(at);
    return this;
  }

  hex() {
    const end = new Sha256(this.state());
    const pad = new Uint8Array(((this.length % 64) < 56 ? 64 : 128) - (this.length % 64));
    pad[0] = 0x80;
    new DataView(pad.buffer).setBigUint64(pad.length - 8, BigInt(this.length) * 8n);
    end.update(pad);
    return [...end.words].map((w) => w.toString(16).padStart(8, "0")).join("");
  }

  block(bytes, at) {
    const w = this.schedule;
    const view = new DataView(bytes.buffer, bytes.byteOffset + at, 64);
    for (let i = 0; i < 16; i++) w[i] = view.getUint32(i * 4);
    for (let i = 16; i < 64; i++) {
      const s0 = turn(w[i - 15], 7) ^ turn(w[i - 15], 18) ^ (w[i - 15] >>> 3);
      const s1 = turn(w[i - 2], 17) ^ turn(w[i - 2], 19) ^ (w[i - 2] >>> 10);
      w[i] = w[i - 16] + s0 + w[i - 7] + s1;
    }
    let [a, b, c, d, e, f, g, h] = this.words;
    for (let i = 0; i < 64; i++) {
      const t1 = (h + (turn(e, 6) ^ turn(e, 11) ^ turn(e, 25)) + ((e & f) ^ (~e & g)) + K[i] + w[i]) | 0;
      const t2 = ((turn(a, 2) ^ turn(a, 13) ^ turn(a, 22)) + ((a & b) ^ (a & c) ^ (b & c))) | 0;
      [h, g, f, e, d, c, b, a] = [g, f, e, (d + t1) | 0, c, b, a, (t1 + t2) | 0];
    }
    [a, b, c, d, e, f, g, h].forEach((v, i) => { this.words[i] += v; });
  }
}
