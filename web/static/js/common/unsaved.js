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
