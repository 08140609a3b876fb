// What came of the take: saved, being analysed, or nothing arrived. Leads to the session when the analysis is done.
import { request } from "../common/api.js";
import { say } from "./words.js";
import { speak } from "../common/words.js";

export class After {
  constructor(root, session) {
    this.root = root;
    this.session = session;
  }

  // watched: the take ran while this page was open; else its session has been there for a while.
  async show(state, watched) {
    const away = state.problem === "node_away" && !state.recording;
    const empty = !state.count && !state.recording && !away;
    const part = state.state === "closed";
    say(this.root.querySelector("[data-over-title]"), away ? speak`The recording has ended` : empty ? speak`Nothing was recorded` : speak`Recording saved`);
    say(this.root.querySelector("[data-over-words]"), away ? speak`The server of this recording is unavailable. Data received so far is stored and will be analysed when it is back.`
      : empty ? speak`No data was received.`
      : part ? speak`It was ended here with the data received so far. Analysis is running; the visit page opens when it is done.`
      : speak`Analysis is running; the visit page opens when it is done.`);
    this.root.querySelector("[data-do=again]").hidden = watched && !empty && !away;
    if (!watched && !empty && !away) return say(this.root.querySelector("[data-over-words]"), speak`This visit already has a recording. A new one replaces it.`);
    if (!empty && !away && !this.following) await this.follow();
  }

  // The newest job of this session; when it is done already the session page has the result.
  async follow() {
    this.following = true;
    const jobs = await request("GET", "/api/v1/jobs?limit=20").catch(() => []);
    const mine = jobs.find((j) => j.session_id === this.session && j.kind === "analyse");
    if (!mine) return setTimeout(() => this.follow(), 1000); // the log is being stored
    const to = `/sessions/${this.session}`;
    if (["done", "failed"].includes(mine.state)) return location.assign(to);
    const progress = document.createElement("job-progress");
    for (const [k, v] of Object.entries({ job: mine.id, since: mine.created_at, done: to, failed: to })) progress.setAttribute(k, v);
    progress.className = "stack g2";
    const words = document.createElement("p"), bar = document.createElement("progress");
    words.className = "small mut";
    words.dataset.message = "";
    words.setAttribute("role", "status");
    bar.max = 1;
    bar.setAttribute("aria-label", speak`Progress`);
    progress.append(words, bar);
    this.root.querySelector("[data-over-job]").replaceChildren(progress);
  }
}
