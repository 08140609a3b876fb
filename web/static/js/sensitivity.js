// <sensitivity-form>: which angles against what, then one job; a reference is uploaded beside it.
import { Problem, request, showProblem } from "./common/api.js";
import { speak } from "./common/words.js";

class SensitivityForm extends HTMLElement {
  connectedCallback() {
    this.base = `/api/v1/sessions/${this.getAttribute("session")}`;
    this.form = this.querySelector("form");
    this.form.addEventListener("submit", (e) => {
      e.preventDefault();
      this.run();
    });
    const input = this.querySelector("[data-file]");
    this.querySelector("[data-pick]")?.addEventListener("click", () => input.click());
    input?.addEventListener("change", () => input.files[0] && this.add(input.files[0]));
  }

  async run() {
    const button = this.querySelector("[type=submit]");
    button.disabled = true;
    try {
      const job = await request("POST", `${this.base}/sensitivities`, {
        reference: this.querySelector("[data-reference]").value || null,
        from_standing: this.form.elements.zero.value === "standing",
      });
      location.assign(`${location.pathname}?run=${job.id}`);
    } catch (problem) {
      button.disabled = false;
      showProblem(this.querySelector(".form-error"), problem);
    }
  }

  async add(file) {
    const say = this.querySelector("[data-say]");
    say.textContent = speak`Uploading ${file.name}…`;
    try {
      const answer = await fetch(`${this.base}/references/${encodeURIComponent(file.name)}`, {
        method: "PUT",
        headers: { "Content-Type": "application/octet-stream" },
        body: file,
      });
      if (!answer.ok) throw new Problem(answer.status, await answer.json().catch(() => ({})));
      const select = this.querySelector("[data-reference]");
      if (![...select.options].some((o) => o.value === file.name)) select.add(new Option(file.name, file.name));
      select.value = file.name;
      say.textContent = "";
    } catch (problem) {
      say.textContent = "";
      showProblem(this.querySelector(".form-error"), problem);
    }
  }
}

customElements.define("sensitivity-form", SensitivityForm);
