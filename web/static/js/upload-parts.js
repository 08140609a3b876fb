// A large file in parts (docs/reference/api.md, "Large files"): after a lost connection, or when the page was loaded again and the file
// is chosen again, it goes on behind what the server has.
import { request, Problem } from "./common/api.js";
import { Sha256 } from "./common/sha256.js";
import { speak } from "./common/words.js";

const PART_BYTES = 4e6;
const LONGEST_WAIT_MS = 15e3;
const AWAY = new Set([0, 502, 503, 504]); // nobody answers, or a proxy says so

/**
 * @param {string} base address of the session in the API
 * @param {{ name: string, file: File }} item
 * @param {{ onSent: (bytes: number) => void, onWait: () => void, signal: AbortSignal }} how
 */
export async function sendInParts(base, { name, file }, { onSent, onWait, signal }) {
  const until = (call) => insist(call, onWait, signal);
  let upload = await until(() => request("POST", `${base}/uploads`, { name, size: file.size }));
  const path = `${base}/uploads/${upload.id}`;
  try {
    for (let again = true; ; again = false) {
      const hash = new Sha256();
      onSent(upload.offset);
      while (hash.length < file.size) {
        // what the server has already is only read, for the sum
        const mine = hash.length < upload.offset ? upload.offset : file.size;
        const slice = file.slice(hash.length, Math.min(hash.length + PART_BYTES, mine));
        const bytes = new Uint8Array(await slice.arrayBuffer());
        signal.throwIfAborted();
        if (hash.length >= upload.offset) {
          upload = await until(() => sendPart(path, hash.length, slice, signal));
          // a part that broke off leaves its beginning there
          hash.update(bytes.subarray(0, upload.offset - hash.length));
          onSent(upload.offset);
        } else {
          hash.update(bytes);
        }
      }
      try {
        return await until(() => request("POST", `${path}/finish`, { sha256: hash.hex() }));
      } catch (problem) {
        // another file of this name and size had begun it: once more from its first byte
        if (problem.code !== "upload_damaged" || !again) throw problem;
        upload = { ...upload, offset: 0 };
      }
    }
  } catch (problem) {
    if (signal.aborted) await request("DELETE", path);
    throw problem;
  }
}

// Answers with how far the server is, also where it has more or less than this page thought.
async function sendPart(path, offset, slice, signal) {
  let answer;
  try {
    answer = await fetch(path, { method: "PATCH", headers: { "Content-Type": "application/octet-stream", "Upload-Offset": `${offset}` }, body: slice, signal });
  } catch {
    signal.throwIfAborted();
  }
  if (answer?.ok) return answer.json();
  const problem = new Problem(answer?.status ?? 0, answer ? await answer.json().catch(() => ({})) : {});
  if (!AWAY.has(problem.status) && problem.code !== "upload_gap" && problem.code !== "upload_cut") throw problem;
  const told = await fetch(path, { method: "HEAD", signal });
  const there = Number(told.headers.get("Upload-Offset"));
  if (!told.ok) throw new Problem(told.status, {});
  if (there === offset) throw new Problem(0, {}); // nothing of it came: wait
  if (there < offset || there > offset + slice.size) throw new Problem(409, { detail: speak`Another page is uploading this file too. Try again.` });
  return { offset: there };
}

// Again and again, ever more seldom and at once when the network says it is back, while nobody answers.
async function insist(call, onWait, signal) {
  for (let wait = 500; ; wait = Math.min(2 * wait, LONGEST_WAIT_MS)) {
    try {
      return await call();
    } catch (problem) {
      if (signal.aborted || !(problem instanceof Problem || problem instanceof TypeError)) throw problem;
      if (problem instanceof Problem && !AWAY.has(problem.status)) throw problem;
      onWait();
    }
    await new Promise((go, no) => {
      const timer = setTimeout(go, wait);
      window.addEventListener("online", () => { clearTimeout(timer); go(); }, { once: true, signal });
      signal.addEventListener("abort", () => { clearTimeout(timer); no(signal.reason); }, { once: true });
    });
  }
}
