// What is prescribed may change while a page waits; with its first sample a take keeps what is in force then.
import { request } from "../common/api.js";

// Calls `changed` with the prescription in force when it is another than the page was made with.
export async function whenOther(data, changed) {
  const all = await request("GET", `/api/v1/patients/${data.patient}/prescriptions`).catch(() => null);
  if (!all) return;
  const now = all.find((p) => p.ended_at === null)?.content ?? null;
  if (plain(now) === plain(data.prescription)) return;
  data.prescription = now;
  changed();
}

// As text in which the order of members does not matter.
function plain(value) {
  return JSON.stringify(value, (_, v) => (v && typeof v === "object" && !Array.isArray(v) ? Object.fromEntries(Object.entries(v).sort()) : v));
}
