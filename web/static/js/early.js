// What is pressed before the page's scripts are there is kept, and pressed again once they are. No module: it is first.
{
  const kept = new Map(); // what was pressed → how it is pressed again
  const keep = (e, what, again) => {
    e.preventDefault();
    e.stopImmediatePropagation();
    kept.set(what, again);
  };
  const click = (e) => {
    const hit = e.target.closest("a, button, input, select, label, summary, tr[data-href]");
    if (!hit?.matches("button[type=button], tr[data-href]")) return; // works without scripts, or is a form's
    if (hit.hasAttribute("command") && "commandForElement" in hit) return; // so does a button that opens a dialog
    keep(e, hit, () => hit.click());
  };
  // A form that a script sends; the browser would write what was typed into the address.
  const submit = (e) => {
    const form = e.target;
    if (form.matches("[data-api], :not([action], [method])")) keep(e, form, () => form.requestSubmit(e.submitter));
  };
  addEventListener("click", click, true);
  addEventListener("submit", submit, true);
  document.addEventListener("DOMContentLoaded", () => { // modules have run by then
    removeEventListener("click", click, true);
    removeEventListener("submit", submit, true);
    for (const again of kept.values()) again();
  });
}
