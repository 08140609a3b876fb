// The JSON API as the pages use it. Errors are RFC 9457 problems: a title, a sentence, a stable code.
import { speak, translate } from "./words.js";
export class Problem extends Error {
  constructor(status, body) {
    super(body.detail || body.title || speak`The server responded with ${status}.`);
    this.status = status;
    this.title = body.title || speak`Action failed`;
    this.detail = body.detail || "";
    this.code = body.code || String(status);
  }
}

/**
 * @param {string} method
 * @param {string} path
 * @param {object} [body] a file is sent as it is, all else as JSON
 * @returns {Promise<any>} what the server answers; an error is thrown as a Problem
 */
export async function request(method, path, body) {
  /** @type {RequestInit} */
  const init = { method, headers: { Accept: "application/json" }, credentials: "same-origin" };
  if (body !== undefined) {
    const isFile = body instanceof Blob;
    init.headers["Content-Type"] = isFile ? "application/octet-stream" : "application/json";
    init.body = isFile ? body : JSON.stringify(body);
  }
  let answer;
  try {
    answer = await fetch(path, init);
  } catch {
    throw new Problem(0, { title: speak`No connection to the server`, detail: speak`Nothing was changed. Check the network and try again.` });
  }
  if (answer.status === 401 && !location.pathname.startsWith("/sign-in")) {
    // a page that keeps what was typed asks to sign in on itself
    if (document.dispatchEvent(new CustomEvent("signed-out", { cancelable: true }))) location.assign(`/sign-in?next=${encodeURIComponent(location.pathname)}`);
  }
  const text = await answer.text();
  const isJson = (answer.headers.get("Content-Type") || "").includes("json");
  const data = isJson && text ? JSON.parse(text) : {};
  if (!answer.ok) throw new Problem(answer.status, data);
  return data;
}

/**
 * Shows a problem as title and sentence in a note with the parts of .form-error.
 * @param {HTMLElement} note
 * Where a second factor is asked for, its field opens.
 * @param {{ title?: string, detail?: string, code?: string }} problem
 */
export function showProblem(note, problem) {
  note.hidden = false;
  note.querySelector("[data-title]").textContent = translate(problem.title) || speak`Action failed`;
  note.querySelector("[data-detail]").textContent = translate(problem.detail);
  note.scrollIntoView({ block: "nearest" });
  if (problem.code !== "code_needed") return;
  /** @type {HTMLDetailsElement | null} */
  const details = note.closest("form").querySelector("details[data-code]");
  if (details) details.open = true;
  details?.querySelector("input").focus();
}
