// A canvas chart: sharp on every screen, coloured by the design tokens, drawn at most once per animation frame.
// Heights and widths come from the stylesheet; a change of the theme draws again.
import { resolveColours } from "../common/colours.js";

const NAMES = [
  "surface", "ink", "ink-2", "ink-3", "axis", "grid", "zero", "left", "left-ink", "right",
  "right-ink", "target", "target-line", "ok", "warn", "bad", "control", "accent", "line-2",
];
const FONT_PX = 11;
export const MEAN_PX = 2.25;
export const THIN_PX = 1;
export const DASH = [6, 3.5]; // the right side, as --dash-right

/**
 * What is drawn into: the size in CSS pixels and the colours by the names of their tokens.
 * @typedef {{ width: number, height: number, colour: Record<string, string> }} Ground
 */

export class Plot extends HTMLElement {
  #asked = false;
  #colours = null;

  connectedCallback() {
    this.canvas = this.querySelector("canvas");
    this.sized = new ResizeObserver(() => this.ask());
    this.sized.observe(this.canvas);
    this.themed = new MutationObserver(() => this.#recolour());
    this.themed.observe(document.documentElement, { attributeFilter: ["data-theme"] });
    this.scheme = matchMedia("(prefers-color-scheme: dark)");
    this.onScheme = () => this.#recolour();
    this.scheme.addEventListener("change", this.onScheme);
    this.ask();
  }

  /**
   * Draws everything; each chart has its own.
   * @param {CanvasRenderingContext2D} _g
   * @param {Ground} _ground
   */
  draw(_g, _ground) {}

  disconnectedCallback() {
    this.sized.disconnect();
    this.themed.disconnect();
    this.scheme.removeEventListener("change", this.onScheme);
  }

  #recolour() {
    this.#colours = null;
    this.ask();
  }

  ask() {
    if (this.#asked || !this.canvas) return;
    this.#asked = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.#prepare();
    });
  }

  #prepare() {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!width || !height) return; // hidden: drawn when it gets a size
    const ratio = devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const colour = (this.#colours ??= resolveColours(this, NAMES));
    const g = this.canvas.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    g.font = `${FONT_PX}px ${getComputedStyle(this).fontFamily}`;
    g.lineJoin = "round";
    this.draw(g, { width, height, colour });
  }
}

/**
 * A polyline that breaks where a value is missing.
 * @param {CanvasRenderingContext2D} g
 * @param {Iterable<[number, number | null]>} points
 */
export function trace(g, points) {
  g.beginPath();
  let pen = false;
  for (const [x, y] of points) {
    if (y === null || Number.isNaN(y)) pen = false;
    else {
      if (pen) g.lineTo(x, y);
      else g.moveTo(x, y);
      pen = true;
    }
  }
  g.stroke();
}

/**
 * Words over lines: a halo in the colour of the ground keeps them readable.
 * @param {CanvasRenderingContext2D} g
 * @param {string} text
 * @param {number} x
 * @param {number} y
 * @param {{ colour: string, halo?: string, align?: CanvasTextAlign, bold?: boolean }} style
 */
export function label(g, text, x, y, { colour, halo, align = "left", bold = false }) {
  const font = g.font;
  if (bold) g.font = `600 ${font}`;
  g.textAlign = align;
  if (halo) {
    g.strokeStyle = halo;
    g.lineWidth = 3;
    g.strokeText(text, x, y);
  }
  g.fillStyle = colour;
  g.fillText(text, x, y);
  g.font = font;
}
