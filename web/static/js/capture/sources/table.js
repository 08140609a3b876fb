// A plain table of ours: a column t_s and, per sensor, <id>.acc_x … gyr_z (m/s², rad/s), if wanted mag_x … (a.u.).
import { speak } from "../../common/words.js";
const CHANNELS = ["acc", "gyr", "mag"].flatMap((kind) => ["x", "y", "z"].map((axis) => `${kind}_${axis}`));

function layoutOf(text) {
  const end = text.indexOf("\n");
  const line = text.slice(0, end < 0 ? 10_000 : end).replace(/^\ufeff/, "").trim();
  for (const separator of [",", ";", "\t"]) {
    const names = line.split(separator).map((n) => n.trim());
    const ids = [...new Set(names.filter((n) => n.endsWith(".acc_x")).map((n) => n.slice(0, -6)))];
    if (names.includes("t_s") && ids.length) return { separator, names, ids, at: end + 1 };
  }
  return null;
}

export const looksLikeTable = (text) => layoutOf(text) !== null;

// One track of all sensors of the table.
export function parseTable(text, name) {
  const { separator, names, ids, at } = layoutOf(text);
  for (const id of ids) {
    const lost = CHANNELS.slice(0, 6).find((c) => !names.includes(`${id}.${c}`));
    if (lost) {
      throw new Error(speak`${name} has no column ${id}.${lost}. Each sensor needs acc_x, acc_y, acc_z, gyr_x, gyr_y and gyr_z.`);
    }
  }
  const time = names.indexOf("t_s");
  const places = ids.map((id) => CHANNELS.map((c) => names.indexOf(`${id}.${c}`)));
  const lines = text.slice(at).split(/\r?\n/).filter((line) => line.trim());
  const rows = lines.map((line) => line.split(separator).map((c) => (c.trim() ? Number(c) : NaN)));
  const backwards = rows.findIndex((row, i) => !(i ? row[time] > rows[i - 1][time] : row[time] >= 0));
  if (rows.length < 2) throw new Error(speak`${name} has no samples. Choose another file.`);
  if (backwards >= 0) {
    throw new Error(speak`${name}: t_s does not increase in row ${backwards + 2}. Times must be in seconds and strictly increasing.`);
  }
  const tUs = Float64Array.from(rows, (row) => Math.round(row[time] * 1e6));
  const steps = Array.from(tUs.subarray(1), (t, i) => t - tUs[i]).sort((a, b) => a - b);
  const values = places.map((columns) => Float32Array.from(rows.flatMap((row) => columns.map((c) => (c < 0 ? NaN : row[c])))));
  return { ids, rateHz: Math.round(1e9 / steps[steps.length >> 1]) / 1000, clock: "shared", tUs, values };
}
