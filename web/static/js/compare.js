// Two visits are compared: the button waits for exactly two ticks.
import { speak } from "./common/words.js";
const parts = [...document.getElementById("compare").elements];
const button = parts.find((e) => e.matches("button"));
const boxes = parts.filter((e) => e.name === "visit");
const update = () => {
  button.disabled = boxes.filter((box) => box.checked).length !== 2;
  button.title = button.disabled ? speak`Tick two visits` : "";
};
boxes.forEach((box) => box.addEventListener("change", update));
update();
