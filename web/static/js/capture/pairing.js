// The code's form: a field, large keys that write into it, and the request when it is complete.
import { request } from "../common/api.js";

const SPLIT = 3;
export const grouped = (code) => [code.slice(0, SPLIT), code.slice(SPLIT)];

export function codeForm(form, { onpaired, onproblem }) {
  const input = form.querySelector("input");
  const keys = form.querySelector("[data-keys]");
  const alphabet = [...keys.querySelectorAll("[data-key]")].map((b) => b.dataset.key).join("");
  const length = Number(input.maxLength) - 1;
  let busy = false;

  const code = () => [...input.value.toUpperCase()].filter((c) => alphabet.includes(c)).join("").slice(0, length);
  const write = (text) => {
    input.value = grouped(text).filter(Boolean).join(" ");
    if (text.length === length) send(text);
  };
  async function send(text) {
    if (busy) return;
    busy = true;
    try {
      onpaired({ ...(await request("POST", "/api/v1/live/pairings", { code: text })), code: text });
      input.value = "";
    } catch (problem) {
      input.value = "";
      input.focus();
      onproblem(problem);
    }
    busy = false;
  }

  input.addEventListener("input", () => write(code()));
  keys.addEventListener("click", (e) => {
    const key = e.target.closest("[data-key]")?.dataset.key;
    if (key) write(code() + key);
    else if (e.target.closest("[data-erase]")) write(code().slice(0, -1));
  });
  form.addEventListener("submit", (e) => e.preventDefault());
}
