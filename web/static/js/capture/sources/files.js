// Files a tablet can play: which kind each is, decided by its content, and its sensors as tracks on one clock.
import { decodeBatch, isLog, scanLog } from "../../common/wire.js";
import { parseMtText, looksLikeMtText } from "./mt_text.js";
import { parseTable, looksLikeTable } from "./table.js";
import { speak } from "../../common/words.js";

// A track: sensors that tick together. {ids, segments, rateHz, clock, tUs: Float64Array(n), values: [Float32Array(n*9)]}
const WRAP = 65536;

async function bytesOf(file) {
  let bytes = new Uint8Array(await file.arrayBuffer());
  if (bytes[0] === 0x1f && bytes[1] === 0x8b) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  }
  return bytes;
}

function textOf(bytes) {
  const utf16 = (bytes[0] === 0xff && bytes[1] === 0xfe) ? "utf-16le" : (bytes[0] === 0xfe && bytes[1] === 0xff) ? "utf-16be" : "utf-8";
  return new TextDecoder(utf16).decode(bytes);
}

// All chosen files → {tracks, segments: device id → segment where a file says so, copies: ids left out}.
export async function readFiles(files) {
  const tracks = [], texts = [], segments = {};
  for (const file of files) {
    const bytes = await bytesOf(file);
    if (isLog(bytes)) {
      tracks.push(...logTracks(bytes, file.name, segments));
      continue;
    }
    const text = textOf(bytes);
    if (looksLikeMtText(text)) texts.push(parseMtText(text, file.name));
    else if (looksLikeTable(text)) tracks.push(parseTable(text, file.name));
    else if (text.trimStart().startsWith("{")) Object.assign(segments, mappingOf(text, file.name));
    else {
      throw new Error(speak`${file.name} is neither Xsens MT Manager text, a Sagittal live log nor a table with time and sensor`
        + speak` columns. Choose such files; others can be uploaded on the visit page.`);
    }
  }
  const { unique, copies } = withoutCopies(texts);
  if (unique.length) tracks.push(counterTrack(unique));
  if (!tracks.length) throw new Error(speak`None of these files is a recording. Choose the sensor files.`);
  return { tracks, segments, copies };
}

// A manifest among the files knows which sensor is where.
function mappingOf(text, name) {
  try {
    return JSON.parse(text).sensors ?? {};
  } catch {
    throw new Error(speak`${name} is not valid JSON. Omit it or choose it again.`);
  }
}

// The same signals under another id (a copied file) would put one sensor on two legs.
function withoutCopies(texts) {
  const unique = [], copies = [];
  for (const one of texts) {
    if (unique.some((u) => u.id === one.id)) {
      throw new Error(speak`Sensor ${one.id} is in two files (${one.name}). Choose the files of a single walk, with each sensor once.`);
    }
    const same = (u) => u.values.length === one.values.length && u.values.every((v, i) => Object.is(v, one.values[i]));
    const twin = unique.find(same);
    if (twin) copies.push({ id: one.id, of: twin.id });
    else unique.push(one);
  }
  return { unique, copies };
}

// Sensors of one Awinda master share its packet counter of 16 bit; they start and end at different counts.
function counterTrack(texts) {
  const rateHz = texts.find((t) => t.rateHz)?.rateHz;
  if (!rateHz) {
    throw new Error(speak`${texts[0].name} does not say its rate. Export it with "Update Rate", or upload it on the session's`
      + speak` page and name the rate there.`);
  }
  const other = texts.find((t) => t.rateHz && Math.abs(t.rateHz - rateHz) > 1e-6);
  if (other) {
    throw new Error(speak`${other.name} has ${other.rateHz} Hz, the others ${rateHz} Hz; one packet counter cannot tick twice.`
      + speak` Choose the files of one walk.`);
  }
  const reference = texts[0].counter[0];
  const counts = texts.map(({ counter }) => {
    const out = Float64Array.from(counter);
    const nearest = (value, to) => value + WRAP * Math.round((to - value) / WRAP);
    out[0] = nearest(out[0], reference);
    for (let i = 1; i < out.length; i++) out[i] = nearest(out[i], out[i - 1]);
    return out;
  });
  const all = [...new Set(counts.flatMap((c) => [...c]))].sort((a, b) => a - b);
  const place = new Map(all.map((count, row) => [count, row]));
  const values = texts.map((text, s) => {
    const out = new Float32Array(all.length * 9).fill(NaN);
    counts[s].forEach((count, i) => out.set(text.values.subarray(i * 9, i * 9 + 9), place.get(count) * 9));
    return out;
  });
  const tUs = Float64Array.from(all, (count) => Math.round(((count - all[0]) * 1e6) / rateHz));
  return { ids: texts.map((t) => t.id), rateHz, clock: "shared", tUs, values };
}

function logTracks(bytes, name, segments) {
  const records = scanLog(bytes);
  if (records[0]?.kind !== "H") throw new Error(speak`${name} is a live log without its first record and cannot be played back.`);
  const hello = JSON.parse(new TextDecoder().decode(records[0].body));
  const batches = records.filter((r) => r.kind === "B").map((r) => decodeBatch(r.body));
  return hello.streams.map((stream) => {
    const mine = batches.filter((b) => b.stream === stream.stream);
    const n = mine.reduce((sum, b) => sum + b.nSamples, 0);
    const tUs = new Float64Array(n), values = stream.sensors.map(() => new Float32Array(n * 9));
    let row = 0, lag = Infinity;
    for (const b of mine) {
      const lastUs = b.t0Us + (b.offsetsUs ? b.offsetsUs.at(-1) : ((b.nSamples - 1) * 1e6) / stream.rate_hz);
      if (b.t0Us - mine[0].t0Us < 1e6) lag = Math.min(lag, b.sentUs - lastUs);
      for (let i = 0; i < b.nSamples; i++, row++) {
        tUs[row] = b.t0Us + (b.offsetsUs ? b.offsetsUs[i] : (i * 1e6) / stream.rate_hz);
        values.forEach((v, s) => {
          const at = (i * b.nImu + s) * 9;
          v.set(b.samples.subarray(at, at + 9), row * 9);
        });
      }
    }
    for (const sensor of stream.sensors) if (sensor.segment) segments[sensor.id] = sensor.segment;
    // clocks of their own meet where their fastest message of the first second was sent (docs/reference/live-protocol.md)
    return {
      ids: stream.sensors.map((s) => s.id), sensors: stream.sensors, rateHz: stream.rate_hz, clock: stream.clock,
      lagUs: stream.clock === "own" ? lag : 0, tUs, values,
    };
  });
}
