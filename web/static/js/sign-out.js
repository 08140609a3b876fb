// The end of a sign-in: told two minutes before, and when it came the page is covered, not left, so that what was
// typed is still there after signing in again.
import { request, showProblem } from "./common/api.js";
import { formatClock } from "./common/words.js";

const SOON_S = 120;
const AGAIN_S = 5; // a sign-in that the server is about to end is asked for once more
const soon = document.getElementById("sign-out-soon");
const out = document.getElementById("signed-out");
const form = out.querySelector("form");
let timer, counting;

/** @returns {Promise<{ name: string, left_s: number } | null>} null = nobody is signed in; throws without a line */
async function ask() {
  const answer = await fetch("/api/v1/sign-in", { credentials: "same-origin", cache: "no-store" });
  if (answer.status === 401) return null;
  if (!answer.ok) throw new Error(String(answer.status));
  return answer.json();
}

function later(seconds) {
  clearTimeout(timer);
  timer = setTimeout(look, 1000 * Math.max(seconds, AGAIN_S));
}

async function look() {
  let state;
  try {
    state = await ask();
  } catch {
    return later(SOON_S); // the server cannot be reached: nothing is known
  }
  if (state === null) return cover();
  if (state.name !== form.elements.name.value) return document.dispatchEvent(new Event("another-person"));
  if (out.open) out.close();
  if (state.left_s > SOON_S) {
    soon.close();
    return later(state.left_s - SOON_S);
  }
  warn(state.left_s);
  later(state.left_s);
}

function warn(left) {
  const end = performance.now() + 1000 * left;
  const show = () => { soon.querySelector("[data-left]").textContent = formatClock((end - performance.now()) / 1000, 1); };
  clearInterval(counting);
  counting = setInterval(show, 1000);
  show();
  if (!soon.open && !out.open) soon.showModal();
}

// Nothing of the page is to be read by who comes next, and nothing of it is lost.
export function cover() {
  clearTimeout(timer);
  clearInterval(counting);
  soon.close();
  if (!out.open) out.showModal();
}

// Any answer of the server prolongs the sign-in.
async function stay() {
  clearInterval(counting);
  soon.close();
  try {
    await request("GET", "/api/v1/account");
  } finally {
    look();
  }
}

soon.addEventListener("close", () => clearInterval(counting));
soon.addEventListener("cancel", (e) => { e.preventDefault(); stay(); });
soon.querySelector("[data-stay]").addEventListener("click", stay);
out.addEventListener("cancel", (e) => e.preventDefault()); // Escape uncovers nothing
form.addEventListener("submit", async (e) => {
  e.preventDefault();
  const { name, password, code } = form.elements, note = form.querySelector(".form-error");
  note.hidden = true;
  try {
    await request("POST", "/api/v1/sign-in", { name: name.value, password: password.value, code: code.value || null });
    out.close();
    look();
  } catch (problem) {
    showProblem(note, problem);
  }
  password.value = "";
});
// a tab that was asleep asks when it is looked at again
document.addEventListener("visibilitychange", () => document.visibilityState === "visible" && look());
look();
