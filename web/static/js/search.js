// Filters the rows of a table while typing and by the kind chosen beside the field; Enter still asks the server.
for (const input of document.querySelectorAll("[data-filter]")) {
  const body = document.getElementById(input.dataset.filter);
  const none = body.closest("section").querySelector("[data-none]");
  const kinds = [...input.closest("form").querySelectorAll("[data-show]")];
  const filter = () => {
    const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
    const kind = kinds.find((b) => b.ariaPressed === "true")?.dataset.show ?? "";
    let shown = 0;
    for (const row of body.rows) {
      row.hidden = !words.every((w) => row.dataset.text.includes(w)) || !(kind === "" || row.dataset.kinds.split(" ").includes(kind));
      shown += row.hidden ? 0 : 1;
    }
    none.hidden = shown > 0;
  };
  input.addEventListener("input", filter);
  for (const button of kinds) {
    button.addEventListener("click", () => {
      for (const b of kinds) b.ariaPressed = String(b === button);
      filter();
    });
  }
}
