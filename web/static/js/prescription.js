// The form of a feedback prescription: targets of this person as one chooses, and one JSON record at the end.
import { request, showProblem } from "./common/api.js";
import { localise, lowered, speak, translate } from "./common/words.js";
import { letGo } from "./forms.js";

const form = document.getElementById("prescription");
const base = `/api/v1/patients/${form.dataset.patient}`;
const option = () => form.elements.parameter.selectedOptions[0];
const checked = (name) => form.querySelector(`input[name="${name}"]:checked`);

const READ = {
  int: (v) => parseInt(v, 10),
  float: (v) => parseFloat(v.replace(",", ".")),
  percent: (v) => parseFloat(v.replace(",", ".")) / 100,
  list: (v) => v.match(/\d+/g).map(Number),
};

function record() {
  const body = { modes: [] };
  for (const el of form.elements) {
    if (!el.name || el.disabled || el.name === "told" || "skip" in el.dataset || (el.type === "radio" && !el.checked)) continue;
    if (el.name === "modes") {
      if (el.checked) body.modes.push(el.value);
      continue;
    }
    const value = el.type === "checkbox" ? el.checked : el.value.trim() === "" ? null : (READ[el.dataset.type] || String)(el.value);
    const [first, second] = el.name.split(".");
    if (second) (body[first] ??= {})[second] = value;
    else body[first] = value;
  }
  const told = form.elements.told.value;
  if (told) body[told] = true;
  if (body.target.source !== "manual") body.target = { source: body.target.source };
  return body;
}

// What is hidden is not part of the record: the server has the defaults.
function arrange() {
  const unit = option().dataset.unit;
  for (const el of form.querySelectorAll("[data-unit]:not(option)")) el.textContent = unit || speak`no unit`;
  show("[data-manual]", checked("target.source")?.value === "manual");
  show("[data-fading]", form.elements["schedule.kind"].value === "fading");
  show("[data-rule]", form.elements["progression.automatic"].checked);
  const shared = "shared" in option().dataset;
  for (const el of form.querySelectorAll('input[name="side"]')) {
    el.disabled = shared && el.value !== "";
    if (shared) el.checked = el.value === "";
  }
  form.querySelector("[data-both]").hidden = !shared;
  show("[data-other]", checked("side").value !== "");
  summarise();
}

// What will be prescribed, in a sentence: nobody has to open "More" to know it.
function summarise() {
  const side = checked("side").value;
  const target = checked("target.source");
  const value = target?.value === "manual" ? (form.elements["target.mean"].value ? speak`as entered` : speak`to be entered under More`) : target?.closest("[data-source]").querySelector("[data-value]").textContent;
  const source = target?.closest("[data-source]").querySelector("b").textContent;
  const told = [...form.querySelectorAll('input[name="modes"]:checked')].map((m) => lowered(m.parentElement.querySelector("b").textContent));
  const what = option().textContent.trim().split(",")[0];
  const wanted = (value || speak`not known yet`) + (source && value && target?.value !== "manual" ? ` (${lowered(source)})` : "");
  form.querySelector("[data-summary]").textContent = speak`${what}, ${translate(side) || speak`both sides`}; target ${wanted}; shown as ${told.join(speak` and `) || speak`nothing selected`}.`;
}

// A preset fills what decides; the target is the first of its sources that gives numbers for this person.
let wanted = [];
function preset(chosen) {
  const { parameter, modes, sources } = chosen.dataset;
  form.elements.parameter.value = parameter;
  for (const m of form.querySelectorAll('input[name="modes"]')) m.checked = modes.split(" ").includes(m.value);
  wanted = sources.split(" ");
}

function show(selector, on) {
  const part = form.querySelector(selector);
  part.hidden = !on;
  for (const el of part.querySelectorAll("input")) el.disabled = !on;
}

let asked = 0;
async function offer() {
  const turn = ++asked;
  const parameter = option().value;
  const ask = (side) => request("GET", `${base}/targets?${new URLSearchParams({ parameter, ...(side && { side }) })}`);
  const gives = (found, source) => found.some((o) => o.source === source && o.mean !== null);
  let side = checked("side").value;
  let offers;
  try {
    offers = await ask(side);
    // a preset trains the side that has something to gain: the other one is the better
    for (const other of ["left", "right"]) {
      if (turn !== asked || wanted[0] !== "own_better_side" || gives(offers, wanted[0])) break;
      const found = other === side ? offers : await ask(other);
      if (gives(found, wanted[0])) [side, offers] = [other, found];
    }
  } catch (problem) {
    return showProblem(form.querySelector(".form-error"), problem);
  }
  if (turn !== asked) return; // something else was chosen meanwhile
  form.querySelector(`input[name="side"][value="${side}"]`).checked = true;
  for (const found of offers) fill(found);
  const first = wanted.find((source) => gives(offers, source));
  if (first) form.querySelector(`input[name="target.source"][value="${first}"]`).checked = true;
  wanted = [];
  const chosen = checked("target.source");
  if (!chosen || chosen.disabled) form.querySelector('input[name="target.source"]:not(:disabled)').checked = true;
  arrange();
}

function fill({ source, mean, sd, words, reason }) {
  if (source === "manual") return;
  const tile = form.querySelector(`[data-source="${source}"]`);
  tile.querySelector("input").disabled = mean === null;
  tile.querySelector("[data-value]").textContent = mean === null ? "" : quantity(mean, sd);
  tile.querySelector("[data-words]").textContent = translate(words ?? reason);
}

function quantity(mean, sd) {
  const { unit, digits } = option().dataset;
  const fine = Number(digits) + (sd < 5 * 10 ** -digits ? 1 : 0);
  const text = localise(`${mean.toFixed(fine)} ± ${sd.toFixed(fine)}`.replace("-", "−"));
  return unit === "°" ? `${text}°` : unit ? `${text}\u202f${unit}` : text;
}

form.addEventListener("change", (e) => {
  if (e.target.matches("[name=preset]")) preset(e.target);
  else if (e.target.matches("[name=parameter], [name=side]")) wanted = []; // who chooses is not put right by a preset
  if (e.target.matches("[name=parameter], [name=modes]")) for (const p of form.querySelectorAll("[name=preset]")) p.checked = false;
  if (e.target.matches("[name=parameter]")) arrange(); // another parameter may belong to both sides
  if (e.target.matches("[name=parameter], [name=side], [name=preset]")) offer();
  arrange();
});

form.addEventListener("submit", async (e) => {
  e.preventDefault();
  const modes = form.querySelectorAll('input[name="modes"]');
  modes[0].setCustomValidity([...modes].some((m) => m.checked) ? "" : speak`Choose at least one.`);
  const hiddenRule = form.querySelector("[data-rule]");
  if (!form.checkValidity() && hiddenRule.querySelector(":invalid")) hiddenRule.open = true;
  if (!form.checkValidity() || form.querySelector('[name="target.source"][value="manual"]').checked) form.querySelector("[data-more]").open = true;
  if (!form.reportValidity()) return;
  const button = form.querySelector("button.primary");
  button.disabled = true;
  try {
    await request("POST", `${base}/prescriptions`, record());
    letGo();
    location.assign(`/patients/${form.dataset.patient}`);
  } catch (problem) {
    button.disabled = false;
    showProblem(form.querySelector(".form-error"), problem);
  }
});

if (checked("preset")) preset(checked("preset"));
arrange();
offer();
