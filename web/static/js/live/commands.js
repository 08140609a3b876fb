// What is pressed on the live page, sent one after the other so that the server sees them in their order.
import { request } from "../api.js";

export class Commands {
  constructor(api, failed) {
    this.api = api;
    this.failed = failed;
    this.last = Promise.resolve();
  }

  send(command, value) {
    return this.#post(`${this.api}/commands`, value === undefined ? { command } : { command, value });
  }

  // Ends the take with what has arrived, when the tablet cannot.
  close() {
    return this.#post(`${this.api}/close`, {});
  }

  #post(path, body) {
    this.last = this.last.then(() => request("POST", path, body)).catch((problem) => this.failed(problem));
    return this.last;
  }
}
