// <video-upload>: sets a video beside a take, once somebody has said that the person agreed.
import { request } from "./common/api.js";
import { StoredFile } from "./common/stored-file.js";

class VideoUpload extends StoredFile {
  connectedCallback() {
    const [consent, input, pick] = ["consent", "file", "pick"].map((name) => this.querySelector(`[data-${name}]`));
    if (!consent) return;
    consent.addEventListener("change", () => { pick.disabled = !consent.checked; });
    pick.addEventListener("click", () => input.click());
    input.addEventListener("change", () => input.files[0] && this.change(() => this.set(input.files[0])));
    this.querySelector("[data-remove]")?.addEventListener("click", () => this.change(() => request("DELETE", this.path())));
  }

  path() { return `/api/v1/sessions/${this.getAttribute("session")}/video`; }

  /** @param {File} file */
  set(file) {
    const query = new URLSearchParams({ name: file.name, consent: "true" });
    return this.send(`${this.path()}?${query}`, file);
  }
}

customElements.define("video-upload", VideoUpload);
