// What the patient reads: short, positive, no numbers, no jargon.
import { capitalise, lowered, speak } from "../common/words.js";

export function what(prescription, term) {
  const name = term?.everyday || (term ? lowered(term.label) : speak`walk`);
  if (prescription.side === "left") return capitalise(speak`left ${name}`);
  return capitalise(prescription.side === "right" ? speak`right ${name}` : name);
}

// The way to the zone, never what was wrong: "A little longer", "Longer".
export function wayTo(zone, term) {
  if (zone === "in") return speak`Good step`;
  const [more, less] = term?.comparison ?? [speak`more`, speak`less`];
  const to = zone.endsWith("low") ? more : less;
  return zone.startsWith("near") ? speak`A little ${to}` : capitalise(to);
}

export const ends = (term) => (term?.comparison ?? ["more", "less"]).map(capitalise);

export const HELD = {
  waiting: [speak`One moment`, speak`The sensors are getting ready.`],
  stand: [speak`Stand still`, speak`Look straight ahead.`],
  walk: [speak`Walk on`, speak`A few steps, straight ahead.`],
  stale: [speak`Short pause`, speak`The picture will return automatically.`],
  paused: [speak`Short pause`, speak`Walk as you like.`],
  none: [speak`Walk as you like`, ""],
  stopped: [speak`Well done`, speak`That was the training.`],
  over: [speak`Well done`, speak`You can stop now.`],
  unopened: [speak`One moment`, speak`It starts soon.`],
};
