// <all-values src>: folds whose rows come with the first one that is opened, and a field that finds a row by name.
class AllValues extends HTMLElement {
  connectedCallback() {
    this.folds = this.querySelector("[data-folds]");
    this.none = this.querySelector("[data-none]");
    const input = this.querySelector("input");
    // "toggle" does not bubble; the folds are replaced when their rows come
    this.folds.addEventListener("toggle", () => this.load(), { capture: true });
    const search = async () => {
      await this.load();
      this.find(input.value.toLowerCase().split(/\s+/).filter(Boolean));
    };
    input.addEventListener("focus", () => this.load());
    input.addEventListener("input", search);
    if (input.value) search(); // typed before the script was there
  }

  load() {
    this.loading ??= this.fetchRows();
    return this.loading;
  }

  async fetchRows() {
    const answer = await fetch(this.getAttribute("src"), { headers: { "x-sagittal-fragment": "values" } });
    if (!answer.ok) {
      this.loading = null; // the link inside each fold still leads there
      return;
    }
    const open = [...this.folds.querySelectorAll("details[open]")].map((fold) => fold.dataset.fold);
    this.folds.innerHTML = await answer.text();
    for (const fold of this.folds.querySelectorAll("details")) fold.open = open.includes(fold.dataset.fold);
  }

  find(words) {
    let shown = 0;
    for (const fold of this.folds.querySelectorAll("details")) {
      let here = 0;
      for (const row of fold.querySelectorAll("tbody tr")) {
        const name = row.cells[0].textContent.replaceAll("\u00ad", "").toLowerCase();
        row.hidden = !words.every((w) => name.includes(w));
        here += row.hidden ? 0 : 1;
      }
      fold.hidden = here === 0;
      fold.open = words.length > 0 && here > 0;
      shown += here;
    }
    this.none.hidden = shown > 0;
  }
}

customElements.define("all-values", AllValues);
