// Xsens MT Manager text, one file per sensor: "//" lines, a header line, rows by tab, comma, semicolon or space.
// The same rules as core/formats/vendors/xsens.py; a browser test holds the two against each other.
import { speak } from "../../common/words.js";
const GROUPS = [["Acc_X", "Acc_Y", "Acc_Z"], ["Gyr_X", "Gyr_Y", "Gyr_Z"], ["Mag_X", "Mag_Y", "Mag_Z"]];
const BLANK_IN_EXPORT = /^(SampleTimeFine|Year|Month|Day|Second|UTC_\w+)$/;
const TICK_S = 1e-4; // SampleTimeFine of MT devices counts 10 kHz ticks

const cells = (line, separator) => line.split(separator).map((c) => c.trim().replace(/^"|"$/g, ""));

function layoutOf(text) {
  const comments = [];
  let at = 0;
  for (let i = 0; i < 64 && at < text.length; i++) {
    const end = text.indexOf("\n", at);
    const line = text.slice(at, end < 0 ? text.length : end).replace(/\r$/, "");
    at = end < 0 ? text.length : end + 1;
    if (!line.trim() || line.trimStart().startsWith("//")) {
      comments.push(line);
      continue;
    }
    for (const separator of ["\t", ",", ";", " "]) {
      const names = cells(line.trimEnd(), separator);
      if (names.includes("PacketCounter") && names.some((n) => /^(Acc|Gyr|FreeAcc|VelInc)_X$/.test(n))) return { comments, names, separator, at };
    }
    return null;
  }
  return null;
}

export const looksLikeMtText = (text) => layoutOf(text) !== null;

// {id, name, rateHz | null, counter: number[], values: Float32Array(n*9)}; throws an Error that says what is missing.
export function parseMtText(text, name) {
  const { comments, names, separator, at } = layoutOf(text);
  const lines = text.slice(at).split(/\r?\n/).filter((line) => line.trim());
  if (!lines.length) throw new Error(speak`${name} has a header but no samples. Record or export it again.`);
  const columns = columnsOf(names, lines[0], separator, name);
  if (columns[0][0] === undefined) {
    const what = names.includes("FreeAcc_X") ? speak`acceleration with gravity` : speak`acceleration`;
    throw new Error(speak`${name} has no ${what} (Acc_X, Acc_Y, Acc_Z). Include it in the export.`);
  }
  if (columns[1][0] === undefined) throw new Error(speak`${name} has no angular rate (Gyr_X, Gyr_Y, Gyr_Z). Include it in the export.`);
  const wanted = columns.flat();
  const number = separator !== "," && !lines[0].includes(".") && /\d,\d/.test(lines[0]) ? (c) => value(c?.replace(",", ".")) : value;
  const counter = [], fine = [];
  const values = new Float32Array(lines.length * 9);
  for (const line of lines) {
    const row = line.split(separator);
    const count = number(row[columns.counter]);
    if (Number.isNaN(count)) continue;
    const base = counter.length * 9;
    for (let c = 0; c < 9; c++) values[base + c] = wanted[c] === undefined ? NaN : number(row[wanted[c]]);
    counter.push(count);
    if (columns.fine !== undefined) fine.push(number(row[columns.fine]));
  }
  return { id: idOf(comments, name), name, rateHz: rateOf(comments, counter, fine), counter, values: values.slice(0, counter.length * 9) };
}

function value(cell) {
  const text = cell?.trim();
  return text ? Number(text) : NaN;
}

// Places of the nine channels; space-separated rows may have lost blank time columns right after the counter.
function columnsOf(names, first, separator, name) {
  const found = first.trimEnd().split(separator).length;
  let shift = 0;
  if (separator === " " && found < names.length) {
    shift = names.length - found;
    if (names[0] !== "PacketCounter" || !names.slice(1, 1 + shift).every((n) => BLANK_IN_EXPORT.test(n))) {
      throw new Error(speak`${name} is separated by spaces and columns are missing. Export it again with tabs or commas.`);
    }
  }
  const place = (n) => {
    const i = names.indexOf(n);
    return i < 0 || (shift && i > 0 && i <= shift) ? undefined : i - (i > 0 ? shift : 0);
  };
  const columns = GROUPS.map((group) => (group.every((n) => names.includes(n)) ? group.map(place) : group.map(() => undefined)));
  return Object.assign(columns, { counter: place("PacketCounter"), fine: place("SampleTimeFine") });
}

// Serial number from the comments, else the last eight hex digits of the file's name, else the name.
function idOf(comments, name) {
  const said = comments.map((line) => line.match(/DeviceId:\s*([0-9A-Fa-f]{8})/)).find(Boolean);
  if (said) return said[1].toUpperCase();
  const stem = name.replace(/^.*[\\/]/, "").replace(/(\.gz)$/, "").replace(/\.[^.]*$/, "");
  const hex = stem.match(/(?<![0-9A-Fa-f])[0-9A-Fa-f]{8}(?![0-9A-Fa-f])/g);
  return hex ? hex.at(-1).toUpperCase() : stem;
}

function rateOf(comments, counter, fine) {
  const said = comments.map((line) => line.match(/Update Rate:\s*(\d{1,5}(?:\.\d+)?)\s*Hz/)).find(Boolean);
  if (said && Number(said[1]) >= 1) return Number(said[1]);
  const steps = [];
  for (let i = 1; i < fine.length; i++) {
    const step = (fine[i] - fine[i - 1]) / (counter[i] - counter[i - 1]);
    if (step > 0) steps.push(step);
  }
  if (steps.length < 10) return null;
  return 1 / (steps.sort((a, b) => a - b)[steps.length >> 1] * TICK_S);
}
