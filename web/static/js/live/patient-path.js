// The path: the stone is the target, it fills when it is hit. Stones and steps come towards the person as they are made.
const PLACES = [[446, 470, 1.06], [468, 286, 0.86], [502, 140, 0.56], [515, 44, 0.36]]; // x, y, size: near to far
const OTHER = [[618, 400, 0.98], [604, 206, 0.62]];
const OFF = 46; // how far from the middle of its stone a step lands that misses by the zone's half, at size 1
const FLAT = 0.72; // the road is seen at an angle
const MIDDLE = 550;

export class Path {
  constructor(scene, { side }, root) {
    this.box = scene.querySelector("[data-stones]");
    this.root = root;
    this.mirrored = side === "right"; // trained feet go on their own side of the road
    this.made = [];
    this.draw();
  }

  show(error, kind) {
    this.made.unshift({ error, kind });
    this.made.length = Math.min(this.made.length, 2);
    this.draw();
  }

  dim() {
    this.made = [];
    this.draw();
  }

  x(x) { return this.mirrored ? 2 * MIDDLE - x : x; }

  place(g, x, y, sx, sy) { g.setAttribute("transform", `translate(${this.x(x)} ${y}) scale(${sx} ${sy})`); }

  draw() {
    const parts = [];
    const foot = this.mirrored ? -1 : 1;
    OTHER.forEach(([x, y, s], i) => {
      const g = this.clone("step");
      g.setAttribute("class", `step ${this.mirrored ? "l" : "r"}${i ? " far" : ""}`);
      this.place(g, x, y, -foot * s, s * FLAT);
      parts.push(g);
    });
    // the newest step is the farther of the two near stones: the road runs towards the person
    PLACES.forEach(([x, y, s], i) => {
      const step = i === 1 ? this.made[0] : i === 0 ? this.made[1] : null;
      const g = this.clone("stone");
      this.place(g, x, y, s, s);
      g.setAttribute("class", `stone ${step ? step.kind : "open"}`);
      const sole = g.querySelector(".step");
      if (step) {
        const off = Math.max(-3, Math.min(3, step.error)) * OFF;
        sole.setAttribute("transform", `translate(0 ${step.kind === "in" ? -off * 0.3 : -off}) scale(${foot * 0.81} ${0.81 * FLAT})`);
        sole.setAttribute("class", `step ${this.mirrored ? "r" : "l"}`);
      } else sole.remove();
      if (step?.kind !== "in") g.querySelector(".done").remove();
      parts.push(g);
    });
    this.box.replaceChildren(...parts);
  }

  clone(name) { return this.root.querySelector(`template[data-${name}]`).content.querySelector("g").cloneNode(true); }
}
