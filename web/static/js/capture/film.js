// What the camera has filmed and the server does not have yet (docs/reference/live-protocol.md, "The film"). Every piece is in
// IndexedDB before it is sent and until it is acknowledged, so that neither a line nor a page that breaks loses one.
import { done, finished } from "./stored.js";

const NAME = "sagittal-film";
const PIECE_BYTES = 1 << 19; // of one request; the server takes twice as much
const PAUSES_S = [0.5, 1, 2, 4, 8];
const WAITING_S = 1; // until the take is over and stored
const GIVEN_UP = [401, 404, 422]; // the token has expired, the take was erased, no browser plays it

function open() {
  const request = indexedDB.open(NAME, 1);
  request.onupgradeneeded = () => {
    request.result.createObjectStore("films", { keyPath: "take" });
    request.result.createObjectStore("pieces"); // [take, number] → bytes
  };
  return done(request);
}

const piecesOf = (take, from = 0) => IDBKeyRange.bound([take, from], [take, Infinity]);

// All films of this tablet; the one that is being filmed is the last. onchange: something was stored or sent.
export class FilmOutbox {
  // Whether a film was ever kept here; a browser that does not tell may have one.
  static async exists() {
    const known = await window.indexedDB?.databases?.().catch(() => null);
    return known ? known.some(({ name }) => name === NAME) : Boolean(window.indexedDB);
  }

  static async open(onchange) {
    const outbox = new FilmOutbox(await open(), onchange);
    for (const film of await outbox.films()) {
      // a page that was loaded again cannot go on filming: what there is, is the film
      if (!film.ended) await outbox.put({ ...film, ended: true });
      outbox.held += film.bytes - film.sentBytes;
    }
    outbox.send();
    return outbox;
  }

  constructor(db, onchange) {
    this.db = db;
    this.onchange = onchange;
    this.held = 0; // bytes that are only here
    this.left = 0; // films that do not stand beside their take
    this.lost = null; // what the server said when it refused a film
    this.current = null;
    this.adding = Promise.resolve();
  }

  films() { return done(this.db.transaction("films").objectStore("films").getAll()); }

  async put(film) {
    const transaction = this.db.transaction("films", "readwrite");
    transaction.objectStore("films").put(film);
    await finished(transaction);
  }

  // beganUs: the first picture, by the clock that stamps the batches.
  async begin({ take, token }, beganUs) {
    this.lost = null;
    this.current = { take, token, beganUs, number: 0, bytes: 0, sentBytes: 0, begun: false, ended: false };
    await this.put(this.current);
    this.send();
  }

  get bytes() { return this.current?.bytes ?? 0; }

  // Keep what the recorder gave, in order; rejects when the tablet is full.
  add(blob) {
    this.adding = this.adding.then(() => this.keep(blob));
    return this.adding;
  }

  async keep(blob) {
    const film = this.current;
    for (let at = 0; at < blob.size; at += PIECE_BYTES) {
      const bytes = await blob.slice(at, at + PIECE_BYTES).arrayBuffer();
      const transaction = this.db.transaction(["films", "pieces"], "readwrite");
      transaction.objectStore("pieces").put(bytes, [film.take, film.number]);
      transaction.objectStore("films").put({ ...film, number: film.number + 1, bytes: film.bytes + bytes.byteLength });
      await finished(transaction);
      film.number += 1;
      film.bytes += bytes.byteLength;
      this.held += bytes.byteLength;
    }
    this.onchange();
    this.send();
  }

  // The film is complete.
  async end() {
    await this.adding.catch(() => {});
    if (!this.current) return;
    this.current.ended = true;
    await this.put(this.current);
    this.current = null;
    this.send();
  }

  // Only one runs; it tries until everything is sent.
  async send() {
    this.asked = true;
    if (this.sending) return;
    this.sending = true;
    let tries = 0;
    for (;;) {
      this.asked = false;
      const step = await this.turn();
      this.onchange();
      tries = step === "broken" ? tries + 1 : 0;
      if (step === "idle" && !this.asked) break;
      const pause = step === "broken" ? PAUSES_S[Math.min(tries, PAUSES_S.length) - 1] : step === "wait" ? WAITING_S : 0;
      if (pause) await new Promise((ok) => setTimeout(ok, 1000 * pause));
    }
    this.sending = false;
  }

  // One step of the first film that has one: "next", "broken" (no line), "wait" (for the end of a take) or "idle".
  async turn() {
    let step = "idle";
    const films = await this.films();
    this.left = films.length;
    for (const film of films) {
      const one = await this.step(film).catch(() => "broken");
      if (one === "next" || one === "broken") return one;
      if (one === "wait") step = one;
    }
    return step;
  }

  // Say the next thing there is to say of a film; "idle" when there is none yet.
  async step(film) {
    if (!film.begun) {
      const answer = await this.ask(film, "POST", "", JSON.stringify({ consent: true, began_us: film.beganUs }));
      if (answer.ok) await this.change(film.take, { begun: true });
      return this.heed(film, answer);
    }
    const [number] = await done(this.db.transaction("pieces").objectStore("pieces").getAllKeys(piecesOf(film.take), 1));
    if (number) {
      const bytes = await done(this.db.transaction("pieces").objectStore("pieces").get(number));
      const answer = await this.ask(film, "PUT", `/${number[1]}`, bytes);
      if (answer.ok) await this.acknowledge(film.take, answer.body.next_piece);
      // a server that stands elsewhere lacks what it had acknowledged
      return answer.status === 409 ? this.forget(film, answer) : this.heed(film, answer);
    }
    if (!film.ended) return "idle";
    const answer = await this.ask(film, "POST", "/end");
    if (answer.ok) return this.forget(film, null);
    return answer.status === 409 ? "wait" : this.heed(film, answer);
  }

  async ask(film, method, more, body) {
    const headers = { Authorization: `Bearer ${film.token}`, Accept: "application/json" };
    if (body) headers["Content-Type"] = method === "PUT" ? "application/octet-stream" : "application/json";
    const answer = await fetch(`/api/v1/live/takes/${film.take}/film${more}`, { method, headers, body, credentials: "omit" });
    return { ok: answer.ok, status: answer.status, body: await answer.json() };
  }

  heed(film, answer) {
    if (answer.ok) return "next";
    if (answer.status === 413) return this.cut(film);
    if (GIVEN_UP.includes(answer.status)) return this.forget(film, answer);
    throw new Error(answer.body.detail); // a full disk, a server that starts: tried again
  }

  // Change the record as it is now: the recorder may have added to it meanwhile.
  async change(take, changes) {
    if (this.current?.take === take) return this.put(Object.assign(this.current, changes));
    const transaction = this.db.transaction("films", "readwrite"), films = transaction.objectStore("films");
    const film = await done(films.get(take));
    if (film) films.put({ ...film, ...changes });
    await finished(transaction);
  }

  // All pieces below `next` are on the server's disk.
  async acknowledge(take, next) {
    const below = IDBKeyRange.bound([take, 0], [take, next], false, true);
    let gone = 0;
    const transaction = this.db.transaction("pieces", "readwrite"), pieces = transaction.objectStore("pieces");
    const request = pieces.openCursor(below);
    request.onsuccess = () => {
      const cursor = request.result;
      if (!cursor) return;
      gone += cursor.value.byteLength;
      cursor.delete();
      cursor.continue();
    };
    await finished(transaction);
    this.held = Math.max(0, this.held - gone);
    const [film] = (await this.films()).filter((x) => x.take === take);
    await this.change(take, { sentBytes: (film?.sentBytes ?? 0) + gone });
  }

  // The server takes no more of this film: the rest is left out.
  async cut(film) {
    await this.acknowledge(film.take, Infinity);
    await this.change(film.take, { ended: true });
    return "next";
  }

  async forget(film, refused) {
    await this.acknowledge(film.take, Infinity);
    const transaction = this.db.transaction("films", "readwrite");
    transaction.objectStore("films").delete(film.take);
    await finished(transaction);
    if (this.current?.take === film.take) this.current = null;
    if (refused) this.lost = refused.body.detail;
    return "next";
  }
}
