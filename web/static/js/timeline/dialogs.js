// The two questions of the timeline: why a stride is left out, and which event is added where.
import { seconds } from "./words.js";
import { speak, translate } from "../common/words.js";

// What strides are left out for, as the question offers it.
export const reasons = () => [...document.querySelectorAll("#why option")].map((o) => o.value).filter(Boolean);

export function askReason(stride, answer) {
  const dialog = document.getElementById("leave-out");
  const form = dialog.querySelector("form");
  const { why, words } = form.elements;
  dialog.querySelector("[data-which]").textContent = speak`The ${translate(stride.side)} stride from ${seconds(stride.start_s)} to ${seconds(stride.end_s)} s will be excluded from all values. Undo restores it.`;
  form.reset();
  words.oninput = () => words.value && (why.value = "");
  form.onsubmit = (e) => {
    e.preventDefault();
    const reason = words.value.trim() || why.value;
    if (!reason) return words.focus();
    dialog.close();
    answer(reason);
  };
  dialog.showModal();
}

export function askEvent({ side, event, time_s }, answer) {
  const dialog = document.getElementById("add-event");
  const form = dialog.querySelector("form");
  form.elements.side.value = side;
  form.elements.event.value = event;
  form.elements.time_s.value = time_s.toFixed(3);
  form.onsubmit = (e) => {
    e.preventDefault();
    dialog.close();
    answer({ side: form.elements.side.value, event: form.elements.event.value, time_s: Number(form.elements.time_s.value) });
  };
  dialog.showModal();
}
