// Numbers as the live pages write them: a real minus, no negative zero, a dash where nothing is.
import { localise, speak } from "../common/words.js";
export function number(value, digits = 0) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return localise(Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−"));
}

export function withUnit(value, term) {
  const text = number(value, term?.digits ?? 2);
  if (text === "–" || !term?.unit) return text;
  return term.unit === "°" ? `${text}°` : `${text}\u2009${term.unit}`;
}

// "47K29M" as two groups of three.
export const code = (text) => `${text.slice(0, 3)} ${text.slice(3)}`;

export function mean(values) {
  const known = values.filter((v) => v !== null && v !== undefined && Number.isFinite(v));
  return known.length ? known.reduce((a, b) => a + b, 0) / known.length : null;
}

const COMPARED = 4; // fewer strides of a side are compared with nothing, as in the report
// Two-sided 95 % quantiles of Student's t for 1, 2, … degrees of freedom: two sides of ten strides have at most 18.
const T95 = [
  12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.16, 2.145, 2.131, 2.12, 2.11, 2.101,
];

// The strides say which side is larger: Welch's 95 % interval of the difference leaves out 0, as in the report.
export function differ(left, right) {
  const [a, b] = [left, right].map((x) => {
    const m = mean(x);
    return { m, of: x.reduce((sum, v) => sum + (v - m) ** 2, 0) / (x.length - 1) / x.length, n: x.length };
  });
  const between = a.of + b.of;
  if (between === 0) return a.m !== b.m;
  const freedom = Math.floor(between ** 2 / (a.of ** 2 / (a.n - 1) + b.of ** 2 / (b.n - 1)));
  return Math.abs(a.m - b.m) > T95[Math.min(Math.max(freedom, 1), T95.length) - 1] * Math.sqrt(between);
}

// Left against right in words, of the values of single strides: "left shorter by 0.05 m"; a difference that does
// not show in the digits is none, and one that the strides leave open is not said.
export function asymmetry(lefts, rights, term) {
  const [known, others] = [lefts, rights].map((x) => x.filter(Number.isFinite));
  const [left, right] = [mean(known), mean(others)];
  if (left === null || right === null || !term) return null;
  if (Math.min(known.length, others.length) < COMPARED) return speak`too few strides to compare`;
  const text = number(Math.abs(left - right), term.digits);
  if (!/[1-9]/.test(text)) return speak`left and right equal`;
  if (!differ(known, others)) return speak`no clear difference`;
  const [more, less] = term.comparison;
  return speak`left ${left > right ? more : less} by ${withUnit(Math.abs(left - right), term)}`;
}

// Sets text only when it changes, so that nothing is read out or laid out again for nothing.
export function say(element, text) {
  if (element && element.textContent !== text) element.textContent = text;
}
