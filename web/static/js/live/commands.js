// What is pressed on the live page, sent one after the other so that the server sees them in their order.
import { request } from "../common/api.js";

export class Commands {
  constructor(api, failed) {
    this.api = api;
    this.failed = failed;
    this.last = Promise.resolve();
  }

  // t: the moment a mark means, in the time of the frames. Answers null when the server refused.
  send(command, value = null, t = null) {
    return this.#post(`${this.api}/commands`, { command, value, t_s: t });
  }

  // Ends the take with what has arrived, when the tablet cannot.
  close() {
    return this.#post(`${this.api}/close`, {});
  }

  /** @returns {Promise<object | null>} */
  #post(path, body) {
    this.last = this.last.then(() => request("POST", path, body)).catch((problem) => {
      this.failed(problem);
      return null;
    });
    return this.last;
  }
}
