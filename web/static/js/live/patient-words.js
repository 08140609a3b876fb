// What the patient reads: short, positive, no numbers, no jargon.
import { capitalise } from "../common/words.js";

export function what(prescription, term) {
  const name = term?.everyday || term?.label.toLowerCase() || "walk";
  return capitalise(prescription.side ? `${prescription.side} ${name}` : name);
}

// The way to the zone, never what was wrong: "A little longer", "Longer".
export function wayTo(zone, term) {
  if (zone === "in") return "Good step";
  const [more, less] = term?.comparison ?? ["more", "less"];
  const to = zone.endsWith("low") ? more : less;
  return zone.startsWith("near") ? `A little ${to}` : capitalise(to);
}

export const ends = (term) => (term?.comparison ?? ["more", "less"]).map(capitalise);

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
