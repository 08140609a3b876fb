// <video-upload>: sets a video beside a take, once somebody has said that the person agreed.
import { request, showProblem } from "./common/api.js";
import { speak } from "./common/words.js";

class VideoUpload extends HTMLElement {
  connectedCallback() {
    const [consent, input, pick] = ["consent", "file", "pick"].map((name) => this.querySelector(`[data-${name}]`));
    if (!consent) return;
    consent.addEventListener("change", () => { pick.disabled = !consent.checked; });
    pick.addEventListener("click", () => input.click());
    input.addEventListener("change", () => input.files[0] && this.change(() => this.send(input.files[0])));
    this.querySelector("[data-remove]")?.addEventListener("click", () => this.change(() => request("DELETE", this.path())));
  }

  path() { return `/api/v1/sessions/${this.getAttribute("session")}/video`; }

  async change(action) {
    try {
      await action();
      location.reload();
    } catch (problem) {
      this.querySelector("[data-say]").textContent = "";
      showProblem(this.querySelector(".form-error"), problem);
    }
  }

  async send(file) {
    this.querySelector("[data-say]").textContent = speak`Uploading ${file.name}…`;
    const query = new URLSearchParams({ name: file.name, consent: "true" });
    await request("PUT", `${this.path()}?${query}`, file);
  }
}

customElements.define("video-upload", VideoUpload);
