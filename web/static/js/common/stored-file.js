// An element that sends a file or removes it: the page is loaded anew then, or its form error says why not.
import { request, showProblem } from "./api.js";
import { speak } from "./words.js";

export class StoredFile extends HTMLElement {
  /** @param {() => Promise<unknown>} action */
  async change(action) {
    try {
      await action();
      location.reload();
    } catch (problem) {
      this.querySelector("[data-say]").textContent = "";
      showProblem(this.querySelector(".form-error"), problem);
    }
  }

  /**
   * @param {string} address
   * @param {File} file
   */
  async send(address, file) {
    this.querySelector("[data-say]").textContent = speak`Uploading ${file.name}…`;
    await request("PUT", address, file);
  }
}
