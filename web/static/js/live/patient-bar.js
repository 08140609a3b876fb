// One bar: long steps on top. The ball is where the last step was, the zone is where it should be.
const TOP = 60, BOTTOM = 420, CENTRE = 178; // the drawing's own units
// In the zone the ball lies wholly inside, out of it wholly outside: nobody has to judge an edge.
const INSIDE = 10, BESIDE = 112, STEP = 44;

export class Bar {
  constructor(scene, { side, lengths, words }) {
    this.ball = scene.querySelector("[data-ball]");
    this.ball.setAttribute("transform", `translate(450 ${CENTRE})`);
    scene.querySelector("[data-feet]").toggleAttribute("hidden", !lengths);
    ["up", "down"].forEach((way, i) => (scene.querySelector(`[data-guide=${way}]`).textContent = lengths ? "" : words[i]));
    // a right sole is a left one mirrored; the foot that steps is the trained one
    for (const g of scene.querySelectorAll(".pict")) {
      const own = g.classList.contains("own"), left = own === (side !== "right");
      g.setAttribute("class", `pict ${own ? "own" : "other"}${own && side ? ` ${side[0]}` : ""}`);
      g.setAttribute("transform", g.getAttribute("transform").replace(/scale\([^)]*\)/, left ? "scale(.6)" : "scale(-.6 .6)"));
    }
  }

  // error in widths of the zone's half, up is more
  show(error, kind) {
    const off = kind === "in" ? INSIDE * error : Math.sign(error) * (BESIDE + STEP * Math.max(0, Math.abs(error) - 1));
    const y = Math.min(BOTTOM, Math.max(TOP, CENTRE - off));
    this.ball.setAttribute("transform", `translate(450 ${y})`);
    this.ball.setAttribute("class", kind);
  }

  dim() { this.ball.setAttribute("class", "hidden"); }
  contact() {}
}
