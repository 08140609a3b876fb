// Security keys (WebAuthn): set up on the page Account, asked for at the door.
import { Problem, request, showProblem } from "./common/api.js";
import { letGo } from "./forms.js";
import { speak } from "./common/words.js";

const noteOf = (form) => form.querySelector(".form-error");

/** @param {HTMLFormElement} form */
const said = (form, name) => /** @type {HTMLInputElement} */ (form.elements.namedItem(name)).value;

// What the browser refuses in words, in the form of a problem of the server.
const TOLD = {
  NotAllowedError: () => speak`The key was not touched in time, or you cancelled. Try again.`,
  InvalidStateError: () => speak`This key is already registered. Use another one.`,
};

/**
 * @param {HTMLFormElement} form
 * @param {() => Promise<void>} work
 */
async function run(form, work) {
  const buttons = form.querySelectorAll("button");
  noteOf(form).hidden = true;
  buttons.forEach((b) => (b.disabled = true));
  try {
    await work();
  } catch (error) {
    buttons.forEach((b) => (b.disabled = false));
    if (error instanceof Problem) return showProblem(noteOf(form), error);
    const detail = TOLD[error.name]?.() ?? speak`Security keys are not available in this browser.`;
    showProblem(noteOf(form), { title: speak`The key did not respond`, detail });
  }
}

async function setUp(form) {
  const proofs = { password: said(form, "password"), code: said(form, "code") };
  const { options } = await request("POST", "/api/v1/account/security-keys/options", proofs);
  const publicKey = PublicKeyCredential.parseCreationOptionsFromJSON(options);
  const made = /** @type {PublicKeyCredential} */ (await navigator.credentials.create({ publicKey }));
  await request("POST", "/api/v1/account/security-keys", { name: said(form, "name"), key: made.toJSON() });
  letGo();
  location.reload();
}

async function signIn(form) {
  const who = { name: said(form, "name"), password: said(form, "password") };
  const { options } = await request("POST", "/api/v1/sign-in/security-key", who);
  const publicKey = PublicKeyCredential.parseRequestOptionsFromJSON(options);
  const answered = /** @type {PublicKeyCredential} */ (await navigator.credentials.get({ publicKey }));
  await request("POST", "/api/v1/sign-in", { ...who, key: answered.toJSON() });
  letGo();
  location.assign(form.dataset.then);
}

document.addEventListener("submit", (e) => {
  const form = /** @type {HTMLFormElement} */ (e.target);
  if (!form.matches("form[data-new-key]")) return;
  e.preventDefault();
  run(form, () => setUp(form));
});

document.addEventListener("click", (e) => {
  const button = e.target.closest("[data-use-key]");
  const form = button?.closest("form");
  if (form && form.reportValidity()) run(form, () => signIn(form));
});
