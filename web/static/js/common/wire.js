// The bytes of sagittal.live.v1, little endian (docs/reference/live-protocol.md): batches as they travel, the log as it is kept.
export const PROTOCOL = "sagittal.live.v1";
export const CHANNELS = 9; // acceleration m/s², rate rad/s, magnetic field a.u.; NaN = not measured
const MAGIC = 0x314c4753; // "SGL1"
const HAS_OFFSETS = 1;
const HEADER = 36;
const LOG_MAGIC = "SAGLIVE1\n";

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

/**
 * CRC-32 as zlib computes it.
 * @param {Uint8Array} bytes
 */
export function crc32(bytes) {
  let c = 0xffffffff;
  for (let i = 0; i < bytes.length; i++) c = TABLE[(c ^ bytes[i]) & 255] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

/**
 * One batch of samples of a stream.
 * @typedef {object} Batch
 * @property {number} stream
 * @property {number} seq
 * @property {number} t0Us time of the first sample
 * @property {number} sentUs
 * @property {number} nImu
 * @property {Float32Array} samples [sample][sensor][channel]
 * @property {Uint32Array | null} [offsetsUs] from t0Us; null where the rate tells
 */

/** @param {Batch} batch */
export function encodeBatch({ stream, seq, t0Us, sentUs, nImu, samples, offsetsUs = null }) {
  const nSamples = samples.length / (nImu * CHANNELS);
  if (!Number.isInteger(nSamples) || nSamples < 1 || nSamples > 1000) {
    throw new RangeError(`a batch has 1 to 1000 samples of ${nImu} sensors, not ${samples.length} numbers`);
  }
  const body = HEADER + samples.length * 4 + (offsetsUs ? nSamples * 4 : 0);
  const view = new DataView(new ArrayBuffer(body + 4));
  view.setUint32(0, MAGIC, true);
  view.setUint16(4, offsetsUs ? HAS_OFFSETS : 0, true);
  view.setUint16(6, nImu, true);
  view.setUint16(8, nSamples, true);
  view.setUint16(10, stream, true);
  view.setBigUint64(12, BigInt(seq), true);
  view.setBigUint64(20, BigInt(Math.round(t0Us)), true);
  view.setBigUint64(28, BigInt(Math.round(sentUs)), true);
  let at = HEADER;
  for (let i = 0; i < samples.length; i++, at += 4) view.setFloat32(at, samples[i], true);
  if (offsetsUs) for (let i = 0; i < nSamples; i++, at += 4) view.setUint32(at, offsetsUs[i], true);
  const bytes = new Uint8Array(view.buffer);
  view.setUint32(body, crc32(bytes.subarray(0, body)), true);
  return bytes;
}

/**
 * What a batch says; throws where the bytes are not one.
 * @param {Uint8Array} bytes
 */
export function decodeBatch(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < HEADER + 4 || view.getUint32(0, true) !== MAGIC) throw new Error("not a batch");
  const flags = view.getUint16(4, true), nImu = view.getUint16(6, true), nSamples = view.getUint16(8, true);
  const floats = nSamples * nImu * CHANNELS;
  const body = HEADER + floats * 4 + (flags & HAS_OFFSETS ? nSamples * 4 : 0);
  if (bytes.length !== body + 4) throw new Error("a batch of another length than it says");
  if (view.getUint32(body, true) !== crc32(bytes.subarray(0, body))) throw new Error("a damaged batch");
  const samples = new Float32Array(floats);
  for (let i = 0; i < floats; i++) samples[i] = view.getFloat32(HEADER + i * 4, true);
  const offsetsUs = flags & HAS_OFFSETS ? new Uint32Array(nSamples) : null;
  for (let i = 0; offsetsUs && i < nSamples; i++) offsetsUs[i] = view.getUint32(HEADER + (floats + i) * 4, true);
  return {
    stream: view.getUint16(10, true), seq: Number(view.getBigUint64(12, true)), t0Us: Number(view.getBigUint64(20, true)),
    sentUs: Number(view.getBigUint64(28, true)), nImu, nSamples, samples, offsetsUs,
  };
}

/**
 * The float32 block alone: what the take's sha256 runs over.
 * @param {Uint8Array} bytes
 */
export function payload(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  return bytes.subarray(HEADER, HEADER + view.getUint16(6, true) * view.getUint16(8, true) * CHANNELS * 4);
}

export const isLog = (bytes) => bytes.length >= LOG_MAGIC.length && text(bytes.subarray(0, LOG_MAGIC.length)) === LOG_MAGIC;

/**
 * Records of a log up to the first damaged one; kind: H, B or F.
 * @param {Uint8Array} bytes
 */
export function scanLog(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const records = [];
  for (let at = LOG_MAGIC.length; at + 8 < bytes.length;) {
    const length = view.getUint32(at, true), end = at + 8 + length;
    if (length < 1 || end > bytes.length) break;
    const body = bytes.subarray(at + 8, end);
    if (crc32(body) !== view.getUint32(at + 4, true)) break;
    records.push({ kind: String.fromCharCode(body[0]), body: body.subarray(1) });
    at = end;
  }
  return records;
}

/**
 * A whole log of a hello and some batches, numbered from 0, as the parts of a Blob.
 * @param {any} hello
 * @param {Uint8Array[]} batches
 * @param {string} sha256 over their payloads
 */
export function logParts(hello, batches, sha256) {
  const record = (kind, body) => {
    const part = new Uint8Array(9 + body.length), view = new DataView(part.buffer);
    part[8] = kind.charCodeAt(0);
    part.set(body, 9);
    view.setUint32(0, body.length + 1, true);
    view.setUint32(4, crc32(part.subarray(8)), true);
    return part;
  };
  const json = (value) => new TextEncoder().encode(JSON.stringify(value));
  const { token: _token, ...rest } = hello; // a log holds no secret
  const numbered = batches.map((bytes, seq) => record("B", renumbered(bytes, seq)));
  return [LOG_MAGIC, record("H", json(rest)), ...numbered, record("F", json({ type: "finish", count: batches.length, sha256 }))];
}

function renumbered(bytes, seq) {
  const copy = bytes.slice(), view = new DataView(copy.buffer), body = copy.length - 4;
  view.setBigUint64(12, BigInt(seq), true);
  view.setUint32(body, crc32(copy.subarray(0, body)), true);
  return copy;
}

function text(bytes) {
  return new TextDecoder().decode(bytes);
}
