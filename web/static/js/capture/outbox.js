// What the tablet holds of one take, in IndexedDB: every batch is stored before it is sent and kept until the server
// has acknowledged it; the running hash is stored with it, so that a reload can go on and finish.
import { done, finished } from "./stored.js";
import { encodeBatch, payload } from "../common/wire.js";
import { Sha256 } from "../common/sha256.js";

const NAME = "sagittal-capture";
const IN_MEMORY = 512; // batches kept besides, so that sending need not read back what was just written
const RETRY_MS = 1000;

function open() {
  const request = indexedDB.open(NAME, 1);
  request.onupgradeneeded = () => {
    request.result.createObjectStore("takes", { keyPath: "take" });
    request.result.createObjectStore("batches");
  };
  return done(request);
}

export class Outbox {
  // The take this tablet has not finished yet, or null.
  static async unfinished() {
    const db = await open();
    const [record] = await done(db.transaction("takes").objectStore("takes").getAll(null, 1));
    if (!record) return db.close(), null;
    // what was acknowledged is gone, and only then; the record was last written with a batch
    const [first] = await done(db.transaction("batches").objectStore("batches").getAllKeys(null, 1));
    return new Outbox(db, { ...record, acked: first ?? record.seq });
  }

  // paired: what the server answered to the code, {take, token, socket, session_title, patient_code}.
  static async begin(paired) {
    const db = await open();
    const record = {
      ...paired, hello: null, source: null, seq: 0, acked: 0, spanS: 0, stopped: false,
      hash: new Sha256().state(), lastUs: {},
    };
    const transaction = db.transaction(["takes", "batches"], "readwrite");
    transaction.objectStore("takes").clear(); // an earlier take was finished or given up before a new code is entered
    transaction.objectStore("batches").clear();
    transaction.objectStore("takes").put(record);
    await finished(transaction);
    return new Outbox(db, record);
  }

  constructor(db, record) {
    this.db = db;
    this.record = record;
    this.hash = new Sha256(record.hash);
    this.stored = record.seq; // batches below are on the tablet's disk
    this.recent = new Map();
    this.waiting = [];
    this.writing = null;
    this.problem = null; // the storage refused: {name}
    this.onstored = () => {};
    this.onproblem = (_problem) => {};
  }

  get acked() { return this.record.acked; }
  get made() { return this.record.seq; }
  // Seconds of signal that are not on the server yet.
  get heldS() { return (this.made - this.acked) * (this.made ? this.record.spanS / this.made : 0); }

  // Give a batch its number and bytes; they are on disk when `stored` has passed it.
  add(batch, rateHz) {
    const seq = this.record.seq++;
    const bytes = encodeBatch({ ...batch, seq });
    const samples = batch.samples.length / (batch.nImu * 9);
    this.record.spanS += samples / rateHz / this.record.hello.streams.length;
    const lastUs = batch.offsetsUs ? batch.offsetsUs.at(-1) : ((samples - 1) * 1e6) / rateHz;
    this.record.lastUs[batch.stream] = batch.t0Us + lastUs;
    this.hash.update(payload(bytes));
    this.waiting.push({ seq, bytes });
    this.writing ??= this.write();
  }

  async write() {
    while (this.waiting.length) {
      const some = this.waiting.slice();
      this.record.hash = this.hash.state();
      try {
        // the record may already count batches made after `some`; what is stored must not
        await this.put({ ...this.record, seq: some.at(-1).seq + 1 }, some);
        this.waiting.splice(0, some.length);
        this.remember(some);
        this.stored = some.at(-1).seq + 1;
        if (this.problem) this.tell(null);
        this.onstored();
      } catch (error) {
        this.tell(error); // acknowledgements free room, so try again
        await new Promise((ok) => setTimeout(ok, RETRY_MS));
      }
    }
    this.writing = null;
  }

  async put(record, batches) {
    const transaction = this.db.transaction(["takes", "batches"], "readwrite");
    transaction.objectStore("takes").put(record);
    const store = transaction.objectStore("batches");
    for (const { seq, bytes } of batches) store.put(bytes, seq);
    await finished(transaction);
  }

  tell(problem) {
    this.problem = problem;
    this.onproblem(problem);
  }

  remember(batches) {
    for (const { seq, bytes } of batches) this.recent.set(seq, bytes);
    for (const seq of this.recent.keys()) {
      if (this.recent.size <= IN_MEMORY) break;
      this.recent.delete(seq);
    }
  }

  // Stored batches from..to−1, in order.
  async read(from, to) {
    const found = [];
    for (let seq = from; seq < to; seq++) {
      const bytes = this.recent.get(seq);
      if (!bytes) return found.length ? found : this.fromDisk(seq, to);
      found.push(bytes);
    }
    return found;
  }

  // Everything that is not acknowledged.
  async all() {
    await this.settled();
    return this.fromDisk(this.acked, this.made);
  }

  fromDisk(from, to) {
    return done(this.db.transaction("batches").objectStore("batches").getAll(IDBKeyRange.bound(from, to, false, true)));
  }

  // All below `ack` are on the server's disk.
  async acknowledge(ack) {
    if (ack <= this.record.acked) return;
    this.record.acked = ack;
    for (const seq of this.recent.keys()) {
      if (seq >= ack) break;
      this.recent.delete(seq);
    }
    const transaction = this.db.transaction("batches", "readwrite");
    transaction.objectStore("batches").delete(IDBKeyRange.upperBound(ack, true));
    await finished(transaction).catch((error) => this.tell(error));
  }

  // The server waits for `next`; more than this tablet remembers is known after a crash of the tablet only.
  resumeAt(next) {
    if (next <= this.record.seq) return;
    this.record.seq = this.record.acked = this.stored = next;
  }

  // Note something about the take itself: hello, source, token, stopped.
  async note(changes) {
    Object.assign(this.record, changes);
    await this.settled();
    await this.put({ ...this.record }, []);
  }

  async settled() {
    while (this.writing) await this.writing;
  }

  sha256() { return this.hash.hex(); }

  // Take everything away: the recording is on the server, or a person gave it up.
  async forget() {
    await this.settled();
    const transaction = this.db.transaction(["takes", "batches"], "readwrite");
    transaction.objectStore("takes").clear();
    transaction.objectStore("batches").clear();
    await finished(transaction);
    this.db.close();
  }
}
