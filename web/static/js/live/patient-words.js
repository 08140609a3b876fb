// What the patient reads: short, positive, no numbers, no jargon.
const NAMES = {
  step_length_m: "step", stride_length_m: "stride", gait_speed_mps: "pace", stance_time_s: "foot on the floor",
  stance_pct: "foot on the floor", swing_time_s: "foot in the air", swing_pct: "foot in the air", stride_time_s: "rhythm",
  step_time_s: "step rhythm", step_width_m: "space between the feet", knee_flexion_max_swing_deg: "knee bend",
  knee_flexion_rom_deg: "knee bend", foot_pitch_ic_deg: "heel first", foot_pitch_tc_deg: "push-off",
  max_heel_clearance_m: "heel height", min_toe_clearance_m: "toe height", single_support_pct: "standing on one foot",
};
export const LENGTHS = new Set(["step_length_m", "stride_length_m"]);

const capital = (text) => text[0].toUpperCase() + text.slice(1);

export function what(prescription, term) {
  const name = NAMES[prescription.parameter] ?? term?.label.toLowerCase() ?? "walk";
  return capital(prescription.side ? `${prescription.side} ${name}` : name);
}

// The way to the zone, never what was wrong: "A little longer", "Longer".
export function wayTo(zone, term) {
  if (zone === "in") return "Good step";
  const [more, less] = term?.comparison ?? ["more", "less"];
  const to = zone.endsWith("low") ? more : less;
  return zone.startsWith("near") ? `A little ${to}` : capital(to);
}

export const ends = (term) => (term?.comparison ?? ["more", "less"]).map(capital);

export const HELD = {
  waiting: ["One moment", "The sensors are getting ready."],
  stand: ["Stand still", "Look straight ahead."],
  walk: ["Walk on", "A few steps, straight ahead."],
  stale: ["Short pause", "The picture comes back by itself."],
  paused: ["Short pause", "Walk as you like."],
  none: ["Walk as you like", ""],
  stopped: ["Well done", "That was the training."],
  over: ["Well done", "You can stop now."],
  unopened: ["One moment", "It starts soon."],
};
