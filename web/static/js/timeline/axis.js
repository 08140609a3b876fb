// Ticks of the time axis, as many as there is room for.
import { h } from "../common/elements.js";
import { seconds } from "./words.js";

const STEPS_S = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200];
const ROOM_PX = 70;

export function ticks(win, width) {
  const most = Math.max(3, Math.floor(width / ROOM_PX));
  const step = STEPS_S.find((s) => win.span / s <= most) ?? STEPS_S.at(-1);
  const digits = step < 0.1 ? 2 : step < 1 ? 1 : 0;
  const found = [];
  for (let i = Math.ceil(win.start / step - 1e-9); i * step <= win.end + 1e-9; i++) {
    const tick = h("span", {}, `${seconds(i * step, digits)}\u2009s`);
    tick.style.left = `${100 * win.place(i * step)}%`;
    found.push(tick);
  }
  return found;
}
