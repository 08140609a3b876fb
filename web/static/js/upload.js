// <upload-area>: files, folders and zips to the session, two at a time, each with its own progress; then the inspection.
import { request, showProblem, Problem } from "./common/api.js";
import { localise, plural, speak } from "./common/words.js";
import { sendInParts } from "./upload-parts.js";

const PARALLEL = 2;
const LARGE_BYTES = 8e6; // a smaller file is sent at once, and again where that breaks
const mb = (n) => localise(`${(n / 1e6).toFixed(n < 1e7 ? 1 : 0)} MB`);

// A dropped folder arrives as entries, 100 at a time; the path inside it becomes part of the file's name.
async function entriesOf(items) {
  const found = [];
  const walk = async (entry, path) => {
    if (entry.isFile) {
      found.push({ name: path + entry.name, file: await new Promise((ok, no) => entry.file(ok, no)) });
      return;
    }
    const reader = entry.createReader();
    for (;;) {
      const part = await new Promise((ok, no) => reader.readEntries(ok, no));
      if (!part.length) break;
      for (const e of part) await walk(e, `${path}${entry.name}/`);
    }
  };
  const roots = [...items].map((i) => i.webkitGetAsEntry?.()).filter(Boolean);
  for (const e of roots) await walk(e, "");
  return found;
}

class UploadArea extends HTMLElement {
  connectedCallback() {
    this.base = `/api/v1/sessions/${this.getAttribute("session")}`;
    this.waiting = [];
    this.active = 0;
    this.failed = 0;
    this.sent = 0;
    this.list = this.querySelector("[data-sending]");
    this.note = this.querySelector(".form-error");
    const drop = this.querySelector("[data-drop]");
    for (const kind of ["files", "folder"]) {
      const input = this.querySelector(`[data-${kind}]`);
      this.querySelector(`[data-pick=${kind}]`).addEventListener("click", () => input.click());
      input.addEventListener("change", () => {
        this.add([...input.files].map((f) => ({ name: f.webkitRelativePath || f.name, file: f })));
        input.value = "";
      });
    }
    const over = (on) => (e) => { e.preventDefault(); drop.classList.toggle("over", on); };
    drop.addEventListener("dragover", over(true));
    drop.addEventListener("dragleave", over(false));
    drop.addEventListener("drop", async (e) => {
      over(false)(e);
      const plain = [...e.dataTransfer.files].map((f) => ({ name: f.name, file: f }));
      const entries = await entriesOf(e.dataTransfer.items);
      this.add(entries.length ? entries : plain);
    });
    window.addEventListener("beforeunload", (e) => { if (this.active) e.preventDefault(); });
    this.querySelector("[data-anyway]").addEventListener("click", () => this.inspect(true));
    document.querySelector("[data-inspect]")?.addEventListener("click", () => this.inspect());
    for (const b of document.querySelectorAll("[data-remove]")) b.addEventListener("click", () => this.remove(b));
  }

  add(files) {
    for (const row of this.querySelectorAll("[data-part]")) if (files.some((f) => f.name === row.dataset.part && String(f.file.size) === row.dataset.size)) row.remove();
    const hidden = /(^|\/)(\.|Thumbs\.db$|desktop\.ini$|__MACOSX\/)/; // system litter of folders, never a recording
    for (const f of files.filter((file) => !hidden.test(file.name))) {
      const row = document.createElement("li");
      row.innerHTML = `<svg class="ico" aria-hidden="true"><use href="#i-file"/></svg><span class="grow"><b class="wrapany"></b>
        <progress max="1" value="0"></progress><span class="xs dim" data-say>Waiting</span></span>
        <button class="btn ghost sm icon" type="button"><svg class="ico s" aria-hidden="true"><use href="#i-x"/></svg></button>`;
      row.querySelector("b").textContent = f.name;
      row.querySelector("progress").setAttribute("aria-label", speak`Uploading ${f.name}`);
      row.querySelector("button").setAttribute("aria-label", speak`Cancel ${f.name}`);
      this.list.append(row);
      this.waiting.push({ ...f, row });
    }
    this.pump();
  }

  pump() {
    while (this.active < PARALLEL && this.waiting.length) this.send(this.waiting.shift());
    const total = this.querySelector("[data-total]");
    const left = this.waiting.length + this.active;
    const all = this.sent + left + this.failed;
    total.hidden = !all;
    this.querySelector("[data-anyway]").hidden = left > 0 || !this.failed || !this.sent;
    total.textContent = left ? plural(all, speak`${this.sent} of ${all} file uploaded`, speak`${this.sent} of ${all} files uploaded`) : this.failed ? plural(this.sent, speak`${this.sent} file uploaded, ${this.failed} not`, speak`${this.sent} files uploaded, ${this.failed} not`) : plural(this.sent, speak`${this.sent} file uploaded`, speak`${this.sent} files uploaded`);
    if (!left && this.sent && !this.failed) this.inspect(true);
  }

  send(item) {
    this.active += 1;
    const say = (t) => (item.row.querySelector("[data-say]").textContent = t);
    const bar = item.row.querySelector("progress");
    const button = item.row.querySelector("button");
    const over = (ok, text) => {
      this.active -= 1;
      if (ok) { this.sent += 1; bar.value = 1; button.remove(); } else { this.failed += 1; }
      say(text);
      item.row.classList.toggle("bad", !ok);
      item.row.classList.toggle("done", ok);
      if (ok) item.row.querySelector("use").setAttribute("href", "#i-check");
      this.pump();
    };
    const show = (sent, total) => { bar.value = sent / total; say(speak`${mb(sent)} of ${mb(total)}`); };
    const leave = () => { item.row.remove(); this.active -= 1; this.pump(); };
    if (item.file.size > LARGE_BYTES) {
      const stop = new AbortController();
      button.onclick = () => stop.abort();
      const how = { signal: stop.signal, onSent: (n) => show(n, item.file.size), onWait: () => say(speak`No connection. The upload resumes automatically.`) };
      sendInParts(this.base, item, how).then(() => over(true, mb(item.file.size)), (problem) => {
        if (stop.signal.aborted) return leave();
        this.retry(item, button);
        over(false, problem.message);
      });
      return;
    }
    const xhr = new XMLHttpRequest();
    xhr.upload.onprogress = (e) => show(e.loaded, e.total);
    xhr.onload = () => {
      if (xhr.status < 300) return over(true, mb(item.file.size));
      let body = {};
      try { body = JSON.parse(xhr.responseText); } catch { /* not a problem document: the status says enough */ }
      this.retry(item, button);
      over(false, new Problem(xhr.status, body).message);
    };
    xhr.onerror = () => { this.retry(item, button); over(false, speak`The connection was lost. Try again.`); };
    xhr.onabort = leave;
    button.onclick = () => xhr.abort();
    const path = item.name.split("/").map(encodeURIComponent).join("/");
    xhr.open("PUT", `${this.base}/files/${path}`);
    xhr.setRequestHeader("Content-Type", "application/octet-stream");
    xhr.send(item.file);
  }

  retry(item, button) {
    button.innerHTML = `<svg class="ico s" aria-hidden="true"><use href="#i-upload"/></svg>`;
    button.setAttribute("aria-label", speak`Try ${item.name} again`);
    button.onclick = () => { this.failed -= 1; this.waiting.push(item); this.pump(); };
  }

  // A worker reads the files; after an upload a table of a shape nobody knows is asked for first (columns.js).
  async inspect(asksFirst = false) {
    try {
      const tables = asksFirst ? await request("GET", `${this.base}/tables`) : [];
      if (!tables.some((table) => table.basis === "guessed")) await request("POST", `${this.base}/inspections`);
      location.reload();
    } catch (problem) {
      showProblem(this.note, problem);
    }
  }

  async remove(button) {
    try {
      await request("DELETE", button.dataset.remove);
      location.reload();
    } catch (problem) {
      showProblem(this.note, problem);
    }
  }
}
customElements.define("upload-area", UploadArea);
