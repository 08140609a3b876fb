// Numbers, sides and times as the live pages write them: a real minus, no negative zero, a dash where nothing is.
export const SIDE = { left: "left", right: "right" };
export const LETTER = { left: "L", right: "R" };
export const SHORT = { left: "l", right: "r" };

export function number(value, digits = 0) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

export function withUnit(value, term) {
  const text = number(value, term?.digits ?? 2);
  if (text === "–" || !term?.unit) return text;
  return term.unit === "°" ? `${text}°` : `${text}\u2009${term.unit}`;
}

export function clock(seconds) {
  const s = Math.max(0, Math.floor(seconds ?? 0));
  return `${String(Math.floor(s / 60)).padStart(2, "0")}:${String(s % 60).padStart(2, "0")}`;
}

export const capital = (text) => (text ? text[0].toUpperCase() + text.slice(1) : "");

// "47K29M" as two groups of three.
export const code = (text) => `${text.slice(0, 3)} ${text.slice(3)}`;

export function mean(values) {
  const known = values.filter((v) => v !== null && v !== undefined && Number.isFinite(v));
  return known.length ? known.reduce((a, b) => a + b, 0) / known.length : null;
}

// Left against right in words: "left shorter by 0.05 m"; a difference that does not show in the digits is none.
export function asymmetry(left, right, term) {
  if (left === null || right === null || !term) return null;
  const text = number(Math.abs(left - right), term.digits);
  if (Number(text) === 0) return "left and right equal";
  const [more, less] = term.comparison;
  return `left ${left > right ? more : less} by ${withUnit(Math.abs(left - right), term)}`;
}

// Sets text only when it changes, so that nothing is read out or laid out again for nothing.
export function say(element, text) {
  if (element && element.textContent !== text) element.textContent = text;
}
