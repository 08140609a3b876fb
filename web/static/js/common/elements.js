// Elements made by name: `h` makes HTML, `s` SVG. An attribute that begins with "on" is a listener; null and false
// leave an attribute out.
import { SIDE_KEY, SIDE_LETTER, translate } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";

/**
 * @template {Element} E
 * @param {E} element
 * @param {Record<string, any>} attributes
 * @param {(Node | string | null | undefined)[]} children
 * @returns {E}
 */
function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((c) => c !== null && c !== undefined));
  return element;
}

/**
 * @param {string} tag
 * @param {Record<string, any>} [attributes]
 * @param {...(Node | string | null | undefined)} children
 */
export const h = (tag, attributes = {}, ...children) => fill(document.createElement(tag), attributes, children);
/**
 * @param {string} tag
 * @param {Record<string, any>} [attributes]
 * @param {...(Node | string | null | undefined)} children
 */
export const s = (tag, attributes = {}, ...children) => fill(document.createElementNS(SVG, tag), attributes, children);

/**
 * A symbol of the page's sprite.
 * @param {string} name
 */
export const icon = (name) => s("svg", { class: "ico s", "aria-hidden": "true" }, s("use", { href: `#i-${name}` }));

/**
 * A side as the chip of the design system.
 * @param {import("./words.js").Side} side
 */
export const chip = (side) => h("span", { class: `lr ${SIDE_KEY[side]}`, title: translate(side) }, SIDE_LETTER[side]);
