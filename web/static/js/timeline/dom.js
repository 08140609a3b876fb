// Elements made by name, as the timeline's parts need them.
const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((c) => c !== null && c !== undefined));
  return element;
}

export const h = (tag, attributes = {}, ...children) => fill(document.createElement(tag), attributes, children);
export const s = (tag, attributes = {}, ...children) => fill(document.createElementNS(SVG, tag), attributes, children);

// A symbol of the page's sprite.
export const icon = (name) => s("svg", { class: "ico s", "aria-hidden": "true" }, s("use", { href: `#i-${name}` }));

export const LETTER = { left: "l", right: "r" };
export const WORD = { ic: "contact", tc: "foot-off" };

// Seconds with a real minus, as many decimals as a sample needs.
export const seconds = (t, digits = 2) => t.toFixed(digits).replace("-", "−");

// The side as the chip of the design system.
export const chip = (side) => h("span", { class: `lr ${LETTER[side]}`, title: side }, side[0].toUpperCase());
