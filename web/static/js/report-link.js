// A link to a signed report: its address and its QR code are told once, on a slip that can be printed.
import { request, showProblem } from "./common/api.js";

const form = /** @type {HTMLFormElement | null} */ (document.querySelector("form[data-link]"));
const slip = document.getElementById("slip");

form?.addEventListener("submit", async (e) => {
  e.preventDefault();
  const days = /** @type {HTMLInputElement} */ (form.elements.namedItem("days")).valueAsNumber;
  try {
    show(await request("POST", form.dataset.link, { days }));
  } catch (problem) {
    showProblem(form.querySelector(".form-error"), problem);
  }
});

/** @param {{ link: { expires_at: string, emergency_id: string | null }, url: string, qr: string }} made */
function show({ link, url, qr }) {
  form.closest("dialog").close();
  const ends = new Date(link.expires_at), { lang } = document.documentElement;
  /** @type {HTMLImageElement} */ (slip.querySelector("[data-qr]")).src = qr;
  slip.querySelector("[data-url]").textContent = url;
  slip.querySelector("[data-until]").textContent = link.emergency_id ? ends.toLocaleString(lang) : ends.toLocaleDateString(lang); // that one ends within hours
  slip.querySelector("[data-copy]").addEventListener("click", () => navigator.clipboard.writeText(url));
  slip.hidden = false;
  slip.scrollIntoView();
}
