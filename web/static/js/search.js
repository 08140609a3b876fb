// Filters the rows of a table while typing; Enter still asks the server.
for (const input of document.querySelectorAll("[data-filter]")) {
  const body = document.getElementById(input.dataset.filter);
  const none = body.closest("section").querySelector("[data-none]");
  const filter = () => {
    const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of body.rows) {
      row.hidden = !words.every((w) => row.dataset.text.includes(w));
      shown += row.hidden ? 0 : 1;
    }
    none.hidden = shown > 0;
  };
  input.addEventListener("input", filter);
}
