// <cycle-charts>: one cursor in all charts inside it, tied to the clock; values of both means beside each title.
import { clock } from "./clock.js";
import { fixed, speak, translate } from "./common/words.js";

const degrees = (v) => (v === null || v === undefined ? "–" : `${Math.round(v) === 0 ? 0 : String(Math.round(v)).replace("-", "−")}°`);

class CycleCharts extends HTMLElement {
  connectedCallback() {
    this.charts = [...this.querySelectorAll("[data-chart]")].map((figure) => this.prepare(figure)).filter(Boolean);
    clock.addEventListener("tick", () => this.show());
    const toggle = this.closest("main").querySelector("[data-strides]");
    toggle?.addEventListener("click", () => {
      const on = toggle.getAttribute("aria-pressed") !== "true";
      toggle.setAttribute("aria-pressed", on);
      this.classList.toggle("nostrides", !on);
    });
    this.show();
  }

  prepare(figure) {
    const chart = figure.querySelector("[data-variable]");
    const plot = chart?.querySelector("svg svg"); // the stretched plot area, 0…1000 both ways
    const line = plot?.querySelector(".cursor");
    if (!line) return null; // a chart without curves says why in words
    const move = (e) => {
      const box = plot.parentElement.getBoundingClientRect();
      const p = (100 * (e.clientX - box.left)) / box.width;
      if (p >= -2 && p <= 102) clock.setPercent(p);
    };
    chart.addEventListener("pointermove", move);
    chart.addEventListener("pointerdown", move);
    return { line, mean: clock.curves[chart.dataset.variable] ?? {}, left: figure.querySelector("[data-left]"), right: figure.querySelector("[data-right]") };
  }

  show() {
    const p = clock.percent;
    for (const { line, mean, left, right } of this.charts) {
      line.toggleAttribute("hidden", p === null);
      if (p !== null) {
        line.setAttribute("x1", 10 * p);
        line.setAttribute("x2", 10 * p);
      }
      const i = p === null ? null : Math.round(p);
      if (left) left.textContent = degrees(i === null ? null : mean.left?.[i]);
      if (right) right.textContent = degrees(i === null ? null : mean.right?.[i]);
    }
  }
}

class StrideStrip extends HTMLElement {
  connectedCallback() {
    this.marks = [...this.querySelectorAll("g")]; // one a stride, in the order of the list
    for (const [index, mark] of this.marks.entries()) {
      const stride = clock.strides[index];
      if (!mark.querySelector("title")) {
        const title = document.createElementNS("http://www.w3.org/2000/svg", "title");
        title.textContent = speak`${translate(stride.side)} stride, ${fixed(stride.start_s, 2)} to ${fixed(stride.end_s, 2)} s`;
        mark.prepend(title);
      }
      mark.addEventListener("click", () => clock.pick(stride));
    }
    clock.addEventListener("tick", () => this.show());
    this.show();
  }

  show() {
    const now = clock.percent === null ? -1 : clock.strides.indexOf(clock.stride);
    for (const [index, mark] of this.marks.entries()) mark.classList.toggle("on", index === now);
    const line = this.querySelector(".now");
    if (line && clock.duration) {
      const x = `${(100 * clock.t) / clock.duration}%`;
      line.setAttribute("x1", x);
      line.setAttribute("x2", x);
    }
    const link = this.querySelector("[data-timeline]");
    if (link) link.hash = `t=${clock.t.toFixed(2)}`;
    const words = this.querySelector("[data-words]");
    if (words && now >= 0) words.textContent = `${clock.stride.side === "left" ? speak`Left` : speak`Right`}, ${fixed(clock.stride.start_s, 1)} s`;
  }
}

customElements.define("cycle-charts", CycleCharts);
customElements.define("stride-strip", StrideStrip);
