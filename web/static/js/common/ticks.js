// Round ticks of a value axis: multiples of 1, 2 or 5 times a power of ten, as server/report/charts/svg.py has them.
const MOST = 5;
const ROUNDING = 1e-9; // of a step: an end of the axis that is a multiple gets its tick

/**
 * Round values inside an axis, at most about `most`, and the decimals they need.
 * @param {number} low
 * @param {number} high
 * @returns {{ ticks: number[], digits: number }}
 */
export function findRoundTicks(low, high, most = MOST) {
  const raw = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= raw);
  const ticks = [];
  for (let i = Math.ceil(low / step - ROUNDING); i <= high / step + ROUNDING; i++) ticks.push(step * i);
  return { ticks, digits: Math.max(0, -Math.floor(Math.log10(step) + ROUNDING)) };
}
