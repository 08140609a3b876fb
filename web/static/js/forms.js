// The theme, forms that speak to the API, dialogs, whole-row links and back buttons: behaviour by data attributes, for every page.
import { request, showProblem } from "./common/api.js";
import { speak } from "./common/words.js";

// Light, dark or as the system says; the choice is remembered on this device.
const root = document.documentElement;
const THEME = "sagittal.theme";
const apply = (t) => { if (t) root.dataset.theme = t; else delete root.dataset.theme; };
try { apply(localStorage.getItem(THEME)); } catch { /* storage refused: follow the system */ }
document.addEventListener("click", (e) => {
  if (!e.target.closest("[data-theme-toggle]")) return;
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  const next = dark ? "light" : "dark";
  apply(next);
  try { localStorage.setItem(THEME, next); } catch { /* as above */ }
});

const LATER_MS = 20_000;
const NOW = "#now"; // of the address of a report that is printed at once

const TYPES = { int: (v) => parseInt(v, 10), float: (v) => parseFloat(v.replace(",", ".")), bool: (v) => v === "true", json: JSON.parse };

function values(form) {
  const body = {};
  for (const el of form.elements) {
    if (!el.name || el.disabled || "skip" in el.dataset) continue;
    if (el.type === "radio" && !el.checked) continue;
    if (el.type === "checkbox" && el.dataset.in) { // one of a list
      body[el.dataset.in] ??= [];
      if (el.checked) body[el.dataset.in].push(el.value);
    } else if (el.type === "checkbox") body[el.name] = el.checked;
    else if (el.value === "" && el.name.includes(".")) continue;
    else if (el.value === "" && !el.required) body[el.name] = "keepEmpty" in el.dataset ? "" : null;
    else put(body, el.name.split("."), (TYPES[el.dataset.type] || String)(el.value));
  }
  return body;
}

// "config.poses.estimator" goes three levels deep.
/** @param {string[]} path */
function put(body, path, value) {
  const [first, ...rest] = path;
  if (rest.length) put((body[first] ??= {}), rest, value);
  else body[first] = value;
}

function same(form) {
  for (const el of form.querySelectorAll("[data-same]")) {
    const ok = el.value === form.elements[el.dataset.same].value;
    el.setCustomValidity(ok ? "" : speak`The two passwords differ.`);
  }
  return form.reportValidity();
}

// "/sessions/{id}" is filled from the answer, so a form can lead to what it made.
const fill = (pattern, data) => pattern.replace(/\{(\w+)\}/g, (_, k) => encodeURIComponent(data[k]));

// A form with two ways on has them on its buttons.
async function send(form, then = form.dataset.then) {
  const [method, path] = form.dataset.api.split(" ");
  const note = form.querySelector(".form-error");
  const buttons = form.querySelectorAll("button");
  buttons.forEach((b) => (b.disabled = true));
  form.setAttribute("aria-busy", "true");
  const sent = method === "DELETE" ? undefined : values(form);
  try {
    const data = await request(method, path, sent);
    if (then?.startsWith("#")) return showOnce(form, then, data);
    if (then === "saved") return showSaved(form, sent);
    letGo();
    if (then === "reload" || !then) location.reload();
    else location.assign(fill(then, data));
  } catch (problem) {
    release(form);
    if (!note) throw problem;
    showProblem(note, problem);
  }
}

function release(form) {
  form.querySelectorAll("button").forEach((b) => (b.disabled = false));
  form.removeAttribute("aria-busy");
}

// The form stays. What was typed while it was sent is not saved yet.
function showSaved(form, sent) {
  release(form);
  form.querySelector(".form-error").hidden = true;
  if (JSON.stringify(values(form)) !== JSON.stringify(sent)) return;
  touched.delete(form);
  form.querySelector("[data-saved]").textContent = speak`Saved`;
}

// What the server tells only once stands in a dialog until it is closed; then the page is read anew.
function showOnce(form, selector, data) {
  const dialog = document.querySelector(selector);
  for (const el of dialog.querySelectorAll("[data-answer]")) {
    if (el instanceof HTMLImageElement) el.src = data[el.dataset.answer];
    else el.textContent = data[el.dataset.answer];
  }
  const before = form.closest("dialog");
  if (before) before.dataset.left = "";
  before?.close();
  dialog.addEventListener("close", () => {
    if ("left" in dialog.dataset) return;
    letGo();
    location.reload();
  });
  dialog.showModal();
}

document.addEventListener("submit", (e) => {
  const form = e.target;
  if (!form.dataset.api) return;
  e.preventDefault();
  if (same(form)) send(form, e.submitter?.dataset.then ?? form.dataset.then);
});
// A choice that names the thing: its name stands in a field as long as nobody wrote another one there.
document.addEventListener("change", ({ target }) => {
  const { form, dataset } = /** @type {HTMLInputElement} */ (target);
  const field = /** @type {HTMLInputElement | undefined} */ (form?.elements[dataset.names]);
  const given = field && [...form.querySelectorAll("[data-name]")].map((choice) => choice.dataset.name);
  if (given?.includes(field.value.trim())) field.value = dataset.name;
});
// A choice that the page is asked anew for.
document.addEventListener("change", (e) => e.target.matches("[data-at-once]") && e.target.closest("form").requestSubmit());
document.addEventListener("input", (e) => e.target.matches("[data-same]") && e.target.setCustomValidity(""));

document.addEventListener("click", (e) => {
  const opener = e.target.closest("[command=show-modal]"); // opens without us, and before us, where the browser knows it
  if (opener && !("commandForElement" in opener)) document.getElementById(opener.getAttribute("commandfor")).showModal();
  if (e.target.closest("[data-close]")) return e.target.closest("dialog").close();
  if (e.target.closest("[data-back]")) return history.back();
  if (e.target.closest("[data-print]")) return window.print();
  const row = e.target.closest("tr[data-href]");
  if (row && !e.target.closest("a,button,select,input,label") && !String(getSelection())) location.assign(row.dataset.href || row.querySelector("a").href); // without an address that of its link
});

// Whoever is away for long is signed out: the watch over that comes once the page stands.
const watch = () => import("./sign-out.js");
if (document.getElementById("signed-out")) {
  setTimeout(watch, LATER_MS);
  document.addEventListener("signed-out", (e) => {
    e.preventDefault();
    watch().then(({ cover }) => cover());
  });
  // signed in from another tab: nothing of this page is theirs
  document.addEventListener("another-person", () => {
    letGo();
    location.assign("/patients");
  });
}

// Ctrl+P on a session prints its report; everywhere else the page itself, without what only a screen needs.
document.addEventListener("keydown", (e) => {
  const report = document.querySelector("a[data-report]");
  if (!report || e.key !== "p" || !(e.ctrlKey || e.metaKey) || e.altKey || e.shiftKey) return;
  e.preventDefault();
  location.assign(`${report.href}${NOW}`);
});
if (location.hash === NOW && document.querySelector("[data-print]")) {
  history.replaceState(null, "", location.pathname);
  window.print();
}

// A text with a limit says how much room is left. What is too long is neither cut nor sent.
const ALWAYS_SHOWN = 1000; // of a longer limit the room is shown when it gets scarce
const SCARCE = 0.1;

function showRoom(area) {
  const limit = Number(area.dataset.limit);
  const left = limit - [...area.value].length;
  const room = area.nextElementSibling?.matches("[data-left]") ? area.nextElementSibling : addRoom(area);
  room.hidden = limit > ALWAYS_SHOWN && left > SCARCE * limit;
  room.classList.toggle("bad", left < 0);
  if (left < 0) room.textContent = left === -1 ? speak`1 character too long` : speak`${-left} characters too long`;
  else room.textContent = left === 1 ? speak`1 character left` : speak`${left} characters left`;
  area.setCustomValidity(left < 0 ? speak`The text is too long: at most ${limit} characters fit.` : "");
  area.ariaInvalid = left < 0 ? "true" : null;
}

function addRoom(area) {
  const room = document.createElement("span");
  Object.assign(room, { className: "help num", id: `left-${area.id}` });
  room.dataset.left = "";
  area.after(room);
  area.setAttribute("aria-describedby", [area.getAttribute("aria-describedby"), room.id].filter(Boolean).join(" "));
  return room;
}

for (const area of document.querySelectorAll("textarea[data-limit]")) showRoom(area);
document.addEventListener("input", ({ target }) => {
  if (target.matches("textarea[data-limit]")) showRoom(target);
  const saved = target.closest("form")?.querySelector("[data-saved]");
  if (saved) saved.textContent = "";
});

// Work that was typed and not sent: the browser asks before the page goes. Every form for the API, and what a page
// marks with data-unsaved; no form with a password, and no dialog that was closed.
const WORK = "form[data-api], [data-unsaved]";
const touched = new Set();
let free = false;

document.addEventListener("input", (e) => {
  const work = e.isTrusted && e.target.closest(WORK);
  if (work && !work.querySelector("input[type=password]")) touched.add(work);
});

const waits = (work) => work.isConnected && (work.closest("dialog")?.open ?? true);

addEventListener("beforeunload", (e) => {
  if (!free && [...touched].some(waits)) e.preventDefault();
});

// What was sent, or must not stay on the screen, goes without a question.
export function letGo() {
  free = true;
}
