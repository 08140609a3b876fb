// Sides, names and times as all pages write them.

/** @typedef {"left" | "right"} Side */

export const SIDE_KEY = { left: "l", right: "r" }; // in classes and in names of angles
export const SIDE_LETTER = { left: "L", right: "R" };

/**
 * The side of a segment, left of "thigh_l"; null in the middle of the body.
 * @param {string | null | undefined} segment
 * @returns {Side | null}
 */
export const sideOf = (segment) => (segment?.endsWith("_l") ? "left" : segment?.endsWith("_r") ? "right" : null);
/**
 * The name of a segment without its side, "thigh" of "Left thigh".
 * @param {string} name
 */
export const withoutSide = (name) => name.replace(/^(Left|Right) | (links|rechts)$/, "");

/** @param {string} text */
export const capitalise = (text) => (text ? text[0].toUpperCase() + text.slice(1) : "");

/**
 * Minutes and seconds, "02:07".
 * @param {number | null | undefined} seconds
 * @param {number} [digits] of the minutes at least
 */
export function formatClock(seconds, digits = 2) {
  const s = Math.max(0, Math.floor(seconds ?? 0));
  return `${String(Math.floor(s / 60)).padStart(digits, "0")}:${String(s % 60).padStart(2, "0")}`;
}
