// States as shape and word: the shapes come from templates in the page, so there is one drawing of each.
import { say } from "./words.js";

export function shape(kind) {
  const found = document.querySelector(`template[data-shape="${kind}"]`);
  return found ? found.content.firstElementChild.cloneNode(true) : document.createElement("span");
}

// Makes an element say a state; nothing is touched when it is the same as before.
export function setState(element, kind, text) {
  if (!element) return;
  if (element.dataset.kind !== kind) {
    element.dataset.kind = kind;
    element.className = `state ${kind}`;
    element.replaceChildren(shape(kind), document.createElement("span"));
  }
  say(element.lastElementChild, text);
}

export function stateOf(kind, text) {
  const element = document.createElement("span");
  setState(element, kind, text);
  return element;
}

// "Left thigh" as a leg chip and a word; what has no side gets a plain chip.
export function segmentCell(segment, name) {
  const cell = document.createElement("td");
  const side = segment?.endsWith("_l") ? "left" : segment?.endsWith("_r") ? "right" : null;
  const chip = document.createElement("span");
  chip.className = side ? `lr ${side[0]}` : "lr plainchip";
  chip.textContent = side ? side[0].toUpperCase() : "–";
  if (side) chip.title = side;
  const word = side ? name.replace(/^(Left|Right) /, "") : name;
  const text = document.createElement("span");
  text.textContent = word[0].toUpperCase() + word.slice(1);
  cell.append(chip, " ", text);
  return cell;
}

export function cell(text, classes = "") {
  const td = document.createElement("td");
  td.className = classes;
  td.textContent = text;
  return td;
}
