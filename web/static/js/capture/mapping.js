// Which segment a sensor is worn on: what its name says, else the clinic's last take with it, else this tablet's.
const KEY = "sagittal.capture.segments";
const PARTS = {
  pelvis: /pelvis|sacrum|lumbar/, thigh: /thigh|femur|up(per)?_?leg/, shank: /shank|tibia|low(er)?_?leg/,
  foot: /foot|calcn/, chest: /chest|torso|sternum|trunk/,
};

export function segmentInName(name) {
  const words = (name ?? "").replace(/([a-z])([A-Z])/g, "$1_$2").replace(/^([LR])([A-Z][a-z])/, "$1_$2").replace(/[\s.-]+/g, "_").toLowerCase();
  const part = Object.keys(PARTS).find((p) => PARTS[p].test(words));
  if (!part || part === "pelvis" || part === "chest") return part ?? null;
  const side = words.match(/(?:^|_)(l|left|r|right)(?:_|$)/);
  return side ? `${part}_${side[1][0]}` : null;
}

function memory() {
  try { return JSON.parse(localStorage.getItem(KEY)) ?? {}; } catch { return {}; }
}

export function remember(segments) {
  try { localStorage.setItem(KEY, JSON.stringify({ ...memory(), ...segments })); } catch { /* storage refused: ask again next time */ }
}

// Give every sensor without a segment a suggestion that no other one has taken; `clinic`: id → segment.
export function suggest(sensors, clinic = {}) {
  const known = { ...memory(), ...clinic };
  const taken = new Set(sensors.map((s) => s.segment).filter(Boolean));
  for (const sensor of sensors) {
    if (sensor.segment || sensor.asked) continue;
    sensor.asked = true;
    const named = segmentInName(sensor.label ?? sensor.id);
    const segment = named ?? known[sensor.id] ?? null;
    if (segment && !taken.has(segment)) {
      sensor.segment = segment;
      sensor.asBefore = named ? null : segment;
      taken.add(segment);
    }
  }
}
