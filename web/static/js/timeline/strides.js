// Strides as blocks over time: stance full, swing pale, left out crossed. Drawn once, moved by the viewBox.
import { SIDE_KEY, fixed, speak, translate } from "../common/words.js";
import { whyOut } from "./words.js";
import { s } from "../common/elements.js";

const MS = 1000; // the x axis of the drawing is in milliseconds, so that rounding is never seen

export class StrideBlocks {
  constructor(host, { sides, onPick }) {
    this.sides = sides;
    this.group = s("g");
    this.svg = s("svg", { class: "chart strip tl-blocks", preserveAspectRatio: "none", "aria-hidden": "true" }, this.group);
    host.append(this.svg);
    this.svg.addEventListener("click", (e) => {
      const mark = e.target.closest("[data-stride]");
      if (mark) onPick(Number(mark.dataset.stride));
    });
  }

  draw(strides) {
    const height = 1000 / this.sides.length;
    this.group.replaceChildren(
      ...strides.flatMap((stride, i) => {
        const row = this.sides.indexOf(stride.side);
        return row < 0 ? [] : [block(stride, i, row * height, height)];
      }),
    );
  }

  show(start, end) {
    this.svg.setAttribute("viewBox", `${start * MS} 0 ${(end - start) * MS} 1000`);
  }

  pick(index) {
    for (const mark of this.group.children) mark.classList.toggle("on", Number(mark.dataset.stride) === index);
  }
}

function block(stride, index, top, height) {
  const k = SIDE_KEY[stride.side];
  const faded = stride.used ? "" : " x";
  const [y, tall] = [top + height * 0.08, height * 0.84];
  const [start, end] = [stride.start_s * MS, stride.end_s * MS];
  const off = stride.tc_s === null ? end : stride.tc_s * MS;
  const why = stride.used ? "" : speak`, excluded: ${whyOut(stride)}`;
  return s(
    "g",
    { "data-stride": index },
    s("title", {}, speak`${translate(stride.side)} stride, ${fixed(stride.start_s, 2)} to ${fixed(stride.end_s, 2)} s${why}`),
    s("rect", { class: `st${k}${faded}`, x: start, width: Math.max(off - start, 0), y, height: tall }),
    s("rect", { class: `sw${k}${faded}`, x: off, width: Math.max(end - off, 0), y, height: tall }),
    stride.used ? null : s("path", { class: "xx", d: `M${start} ${y + tall * 0.1}L${end} ${y + tall * 0.9}M${start} ${y + tall * 0.9}L${end} ${y + tall * 0.1}` }),
  );
}
