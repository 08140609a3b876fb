// States as shape and word: the shapes come from templates in the page, so there is one drawing of each.
import { chip, h } from "../common/elements.js";
import { capitalise, sideOf, withoutSide } from "../common/words.js";
import { say } from "./words.js";

export function shape(kind) {
  const found = document.querySelector(`template[data-shape="${kind}"]`);
  return found ? found.content.firstElementChild.cloneNode(true) : h("span");
}

// Makes an element say a state; nothing is touched when it is the same as before.
export function setState(element, kind, text) {
  if (!element) return;
  if (element.dataset.kind !== kind) {
    element.dataset.kind = kind;
    element.className = `state ${kind}`;
    element.replaceChildren(shape(kind), h("span"));
  }
  say(element.lastElementChild, text);
}

export function stateOf(kind, text) {
  const element = h("span");
  setState(element, kind, text);
  return element;
}

// "Left thigh" as a leg chip and a word; what has no side gets a plain chip.
export function segmentCell(segment, name) {
  const side = sideOf(segment);
  const mark = side ? chip(side) : h("span", { class: "lr plainchip" }, "–");
  return h("td", {}, mark, " ", h("span", {}, capitalise(side ? withoutSide(name) : name)));
}

export const cell = (text, classes = "") => h("td", { class: classes }, text);
