// <filter-choice>: whole engines or single filters, then one job. <reference-files>: orientations of another system.
import { Problem, request, showProblem } from "./common/api.js";
import { StoredFile } from "./common/stored-file.js";
import { speak } from "./common/words.js";

class FilterChoice extends HTMLElement {
  connectedCallback() {
    this.form = this.querySelector("form");
    /** @type {HTMLInputElement[]} */
    this.filters = [...this.querySelectorAll("[data-filter]")];
    this.addEventListener("change", (e) => {
      const engine = /** @type {HTMLInputElement} */ (e.target).closest("[data-engine]");
      if (engine) for (const box of engine.closest("fieldset").querySelectorAll("[data-filter]")) box.checked = engine.checked;
      this.show();
    });
    this.form.addEventListener("submit", (e) => {
      e.preventDefault();
      this.run();
    });
    this.show();
  }

  chosen() {
    return this.filters.filter((box) => box.checked).map((box) => box.value);
  }

  show() {
    for (const engine of this.querySelectorAll("[data-engine]")) {
      const boxes = [...engine.closest("fieldset").querySelectorAll("[data-filter]")];
      const on = boxes.filter((box) => box.checked).length;
      engine.checked = on === boxes.length;
      engine.indeterminate = on > 0 && on < boxes.length;
    }
    const n = this.chosen().length;
    this.querySelector("[data-count]").textContent = speak`${n} of ${this.filters.length} selected`;
  }

  async run() {
    const button = this.querySelector("[type=submit]");
    if (!this.chosen().length) {
      showProblem(this.querySelector(".form-error"), new Problem(422, { title: speak`No filter chosen`, detail: speak`Choose one or more; two show how far they differ.` }));
      return;
    }
    button.disabled = true;
    try {
      await request("POST", `/api/v1/sessions/${this.getAttribute("session")}/filter-runs`, {
        filters: this.chosen(),
        magnetometer: this.querySelector("[data-magnetometer]").checked,
        reference: this.querySelector("[data-reference]").value || null,
      });
      location.assign(location.pathname);
    } catch (problem) {
      button.disabled = false;
      showProblem(this.querySelector(".form-error"), problem);
    }
  }
}

class ReferenceFiles extends StoredFile {
  connectedCallback() {
    this.base = `/api/v1/sessions/${this.getAttribute("session")}/references/`;
    const input = this.querySelector("[data-file]");
    this.querySelector("[data-pick]")?.addEventListener("click", () => input.click());
    input?.addEventListener("change", () => {
      const [file] = input.files;
      if (file) this.change(() => this.send(this.base + encodeURIComponent(file.name), file));
    });
    for (const button of this.querySelectorAll("[data-remove]")) {
      button.addEventListener("click", () => this.change(() => request("DELETE", this.base + encodeURIComponent(button.dataset.remove))));
    }
  }
}

customElements.define("filter-choice", FilterChoice);
customElements.define("reference-files", ReferenceFiles);
for (const select of document.querySelectorAll("select[data-show]")) select.addEventListener("change", () => select.form.requestSubmit());
