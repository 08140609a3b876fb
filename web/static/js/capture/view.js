// What <capture-page> shows of its state; decides nothing.
import { grouped } from "./pairing.js";
import { POSES } from "./sources/axes.js";
import { SensorList } from "./sensors.js";
import { STAND_S } from "../common/standing.js";
import { h } from "../common/elements.js";
import { capitalise, formatClock, lowered, plural, speak } from "../common/words.js";
import * as words from "./words.js";

const VERDICTS = { pass: "ok", redo: "bad", not_judged: "" }; // the look of a note
const MOST_REASONS = 3;
const ADD = { dot: speak`Add sensor`, replay: speak`Other files` };

export class View {
  constructor(root, { onplaced }) {
    this.root = root;
    this.part = (name) => root.querySelector(`[data-${name}]`);
    this.list = new SensorList(root, { onplaced });
    this.staged = [...root.querySelectorAll("[data-on]")];
  }

  unavailable(kind, why) {
    const button = this.root.querySelector(`[data-source=${kind}]`);
    button.disabled = true;
    button.querySelector("[data-why]").textContent = why;
  }

  // Ask before something is lost; true = yes.
  sure(title, text, yes) {
    const dialog = this.part("sure");
    set(this.part("sure-title"), title);
    set(this.part("sure-text"), text);
    set(this.part("sure-yes"), yes);
    dialog.returnValue = "";
    dialog.showModal();
    return new Promise((ok) => dialog.addEventListener("close", () => ok(dialog.returnValue === "yes"), { once: true }));
  }

  draw(m) {
    for (const element of this.staged) element.hidden = !element.dataset.on.split(" ").includes(m.state);
    this.badge(m);
    this.pairing(m);
    this.sensors(m);
    this.saying(m);
    this.verdict(m);
    this.note(m.problem ?? this.trouble(m));
    this.button(m);
  }

  badge({ link, state }) {
    const shown = state === "running" || state === "sending" ? link : null;
    const key = shown ? shown.kind + shown.text : "";
    if (this.part("link").dataset.shown === key) return;
    this.part("link").dataset.shown = key;
    this.part("link").className = shown ? `badge ${shown.kind}` : "";
    this.part("link").replaceChildren(...(shown ? [this.list.shape(shown.kind), shown.text] : []));
  }

  pairing({ record }) {
    if (!record) return;
    const [a, b] = grouped(record.code ?? "");
    this.part("code").setAttribute("aria-label", [...a].join(" ") + ", " + [...b].join(" "));
    if (this.part("code").textContent !== a + b) {
      this.part("code").replaceChildren(...[a, b].map((text) => Object.assign(document.createElement("span"), { textContent: text })));
    }
    set(this.part("paired"), speak`Paired with ${record.patient_code}`);
    set(this.part("session-title"), record.session_title);
  }

  sensors({ state, source, rows, ready, paused, record }) {
    const prepare = state === "prepare";
    const kind = source?.kind;
    this.part("sources").hidden = !prepare || Boolean(source);
    this.part("other").hidden = !prepare || !source;
    this.part("add").hidden = !prepare || !(kind in ADD);
    this.part("end").hidden = !paused || state !== "running";
    set(this.part("add-word"), ADD[kind] ?? "");
    const worn = rows.filter(({ sensor }) => sensor.segment).length;
    const n = source?.copies?.length ?? 0;
    const copies = n ? plural(n, speak`, 1 copy excluded`, speak`, ${n} copies excluded`) : "";
    const counted = speak`${ready.length} of ${rows.length} ready${copies}`;
    const recorded = paused ? speak`${rows.length} of ${wanted(record)} connected` : speak`${worn} recorded`;
    set(this.part("sum"), !source ? speak`Source of the sensors` : prepare ? counted : recorded);
    const before = prepare ? rows.filter(({ sensor }) => sensor.segment && sensor.segment === sensor.asBefore).length : 0;
    this.part("as-before").hidden = !before;
    set(this.part("as-before-say"), words.asBefore(before));
    this.list.draw(prepare || paused ? rows : rows.filter(({ sensor }) => sensor.segment), { fixed: !prepare });
    this.axes(source, prepare);
  }

  // The self-test of the device's own axes.
  axes(source, prepare) {
    this.part("axes").hidden = !prepare || source?.kind !== "device_motion";
    if (this.part("axes").hidden) return;
    const { test, axes } = source;
    if (axes) {
      set(this.part("axes-say"), speak`Axes of this device checked`);
      const fit = Math.max(1, Math.round(axes.errorDeg));
      set(this.part("axes-more"), speak`Rotation agreed with gravity within ${fit}°. This is remembered until the browser is updated.`);
    } else if (source.isMute()) {
      set(this.part("axes-say"), speak`This device sends no motion data`);
      set(this.part("axes-more"), speak`Use a phone or a tablet with a motion sensor, or choose another source.`);
    } else if (test.problem) {
      set(this.part("axes-say"), speak`The check failed`);
      set(this.part("axes-more"), test.problem);
    } else {
      set(this.part("axes-say"), speak`${test.still.length + 1} of ${POSES.length}: ${test.pose.words}`);
      set(this.part("axes-more"), speak`Hold it still for a second. Browsers define the axes differently, so they are measured once.`);
    }
    this.part("axes-again").hidden = !axes && !test.problem;
  }

  saying({ state, stage, toDo, elapsedS, heldS, paused }) {
    const say = state === "sending" ? words.sendingRest(heldS) : paused ? words.RELOADED : words.instruction(stage, elapsedS, toDo);
    set(this.part("say"), say.title);
    set(this.part("say-more"), say.more);
    this.part("say-icon").setAttribute("href", `#i-${say.icon}`);
    set(this.part("elapsed"), state === "running" && !paused ? formatClock(elapsedS, 1) : "");
  }

  // Whether the calibration passes; where not, what to do first.
  verdict({ state, verdict }) {
    const shown = state === "running" ? verdict : null;
    const box = this.part("verdict");
    box.hidden = !shown;
    if (!shown || box.dataset.said === JSON.stringify(shown)) return;
    box.dataset.said = JSON.stringify(shown);
    const kind = VERDICTS[shown.verdict];
    box.className = `note ${kind}`;
    box.replaceChildren(
      this.list.shape(kind || "none"),
      h("b", {}, shown.headline),
      ...byTodo(shown.redo).slice(0, MOST_REASONS).map(({ places, title, why, todo }) =>
        h("p", {}, h("b", {}, capitalise(`${places.join(" and ")}: `)), `${title}. ${why} ${todo}`)),
      shown.verdict === "redo" ? h("p", {}, words.REDO) : "",
    );
  }

  // The first thing that is wrong, where nothing else was said.
  trouble({ state, rows, link, linkSays, source }) {
    if (state !== "prepare" && state !== "running") return null;
    if (link?.kind === "bad" && linkSays) return words.serverFull(linkSays.detail);
    if (source?.kind === "device_motion" && !source.axes) return null;
    const bad = rows.find(({ sensor, health }) => sensor.segment && health.kind === "bad");
    if (!bad) return null;
    const { number, sensor, health } = bad;
    return words.sensorProblem(number, lowered(this.list.names[sensor.segment]), sensor, health, state === "running");
  }

  note(problem) {
    this.part("error").hidden = !problem;
    set(this.part("title"), problem?.title ?? "");
    set(this.part("detail"), problem?.detail ?? "");
  }

  button({ state, source, ready, rows, paused, room }) {
    const go = this.part("go");
    const n = ready.length;
    const missing = !source ? speak`Choose the source of the sensors` : rows.length ? this.reason(source) : speak`Add a sensor`;
    const start = n ? plural(n, speak`Start with 1 sensor`, speak`Start with ${n} sensors`) : missing;
    const word = {
      loading: speak`One moment`, stuck: speak`Save or delete the remaining data`, pairing: speak`Enter the code`, prepare: start,
      sending: speak`Sending`, done: speak`Start another`, running: paused ? speak`Connect the sensors again` : speak`Stop`,
    }[state];
    set(this.part("go-word"), word);
    go.disabled = ["loading", "stuck", "pairing", "sending"].includes(state) || (state === "prepare" && !n);
    go.classList.toggle("stop", state === "running" && !paused);
    const keeps = speak`Nothing is lost if the network drops: ${words.hours(room)}.`;
    const hints = { prepare: speak`Stand still for ${STAND_S} seconds after the tone. ${keeps}`, running: keeps, sending: keeps };
    set(this.part("hint"), hints[state] ?? "");
  }

  reason(source) {
    if (source.kind === "device_motion" && !source.axes) return speak`Check its axes first`;
    return speak`Assign the sensors to segments`;
  }
}

const wanted = (record) => record.hello.streams.reduce((sum, stream) => sum + stream.sensors.length, 0);

function set(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// What several sensors are to do for one reason is said once.
function byTodo(redo) {
  const said = new Map();
  for (const { place, title, why, todo } of redo) {
    const key = title + why;
    if (!said.has(key)) said.set(key, { places: [], title, why, todo });
    said.get(key).places.push(place || "walk");
  }
  return [...said.values()];
}
