// The list of sensors: where each is worn, how fast it sends, its battery and its state; a tap says where it is worn.
import { SIDE_KEY, SIDE_LETTER, capitalise, sideOf, speak, withoutSide } from "../common/words.js";

const NEAR = 0.03;


export class SensorList {
  constructor(root, { onplaced }) {
    this.list = root.querySelector("[data-list]");
    this.template = root.querySelector("[data-row]").content;
    this.shapes = root.querySelector("[data-shapes]").content;
    this.dialog = root.querySelector("[data-places]");
    this.onplaced = onplaced;
    this.names = Object.fromEntries([...this.dialog.querySelectorAll(".place")].map((b) => [b.value, b.firstChild.textContent.trim()]));
    this.dialog.addEventListener("close", () => this.placed(this.dialog.returnValue));
  }

  // Part and side apart, as "Thigh" and L; the names of the server begin with the side.
  words(segment) {
    if (!segment) return speak`Not assigned`;
    return capitalise(withoutSide(this.names[segment]));
  }

  shape(kind) {
    return this.shapes.querySelector(`[data-shape=${kind}]`).firstElementChild.cloneNode(true);
  }

  draw(rows, { fixed }) {
    while (this.list.children.length > rows.length) this.list.lastElementChild.remove();
    while (this.list.children.length < rows.length) this.list.append(this.template.cloneNode(true));
    rows.forEach((row, i) => this.row(this.list.children[i], row, fixed));
  }

  row(li, { number, sensor, health }, fixed) {
    const part = (name) => li.querySelector(`[data-${name}]`);
    const side = sideOf(sensor.segment);
    li.className = sensor.segment ? health.kind : "unused";
    li.dataset.sensor = sensor.id;
    set(part("place"), String(number));
    set(part("segment"), this.words(sensor.segment));
    part("side").hidden = !side;
    part("side").className = `lr ${SIDE_KEY[side] ?? ""}`;
    set(part("side"), SIDE_LETTER[side] ?? "");
    const name = sensor.label && sensor.label !== sensor.id ? `${sensor.label}, ${sensor.id}` : sensor.id;
    set(part("id"), [name, health.note].filter(Boolean).join(", "));
    // counted over two seconds a rate is good to a batch: nearer than that it is the one the sensor says
    const rate = Math.abs(health.rateHz - sensor.rateHz) < NEAR * sensor.rateHz ? sensor.rateHz : health.rateHz;
    set(part("rate"), `${Math.round(rate)} Hz`);
    for (const button of [part("place"), part("place-too")]) {
      button.disabled = fixed;
      const where = sensor.segment ? this.names[sensor.segment] : speak`not assigned`;
      button.setAttribute("aria-label", speak`Sensor ${sensor.id}: ${where}. Change`);
      button.onclick = () => this.ask(sensor);
    }
    const known = sensor.battery !== null && sensor.battery !== undefined;
    part("bat").hidden = part("batn").hidden = !known;
    if (known) {
      part("bat").setAttribute("aria-label", speak`Battery ${sensor.battery} percent`);
      part("bat").firstElementChild.style.width = `${sensor.battery}%`;
      set(part("batn"), `${sensor.battery} %`);
    }
    const state = sensor.segment ? health : { kind: "none", text: speak`Not used` };
    if (part("state").dataset.shown !== state.kind + state.text) {
      part("state").dataset.shown = state.kind + state.text;
      part("state").className = `state ${state.kind}`;
      part("state").replaceChildren(this.shape(state.kind), state.text);
    }
  }

  ask(sensor) {
    this.asked = sensor;
    const called = sensor.label && sensor.label !== sensor.id ? `, ${sensor.label}` : "";
    this.dialog.querySelector("[data-which]").textContent = speak`Sensor ${sensor.id}${called}`;
    for (const b of this.dialog.querySelectorAll(".place")) b.setAttribute("aria-pressed", b.value === sensor.segment);
    this.dialog.returnValue = "";
    this.dialog.showModal();
  }

  placed(value) {
    if (value && this.asked) this.onplaced(this.asked, value === "none" ? null : value);
    this.asked = null;
  }
}

// The list is drawn again every half second; what has not changed is left alone for screen readers.
function set(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
