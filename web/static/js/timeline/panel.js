// What stands beside and below the drawing: the picked stride, the changes, and the table of strides in view.
import { chip, h, icon } from "../common/elements.js";
import { reasons } from "./dialogs.js";
import { WORD, seconds, whyOut } from "./words.js";
import { fixed, lowered, speak, translate } from "../common/words.js";

const LISTED = 40;

const stance = (s) => (s.tc_s === null ? "–" : fixed((100 * (s.tc_s - s.start_s)) / (s.end_s - s.start_s), 1));

// The picked stride with its three events as fields, and whether it counts.
export function strideBox(stride, { editable, review, onMove, onDelete, onLeaveOut, onCount }) {
  if (!stride) return [h("p", { class: "small mut" }, speak`No stride here. Select one above, or press J.`)];
  const rows = [
    ["ic", speak`Contact`, stride.start_s],
    ["tc", speak`Foot-off`, stride.tc_s],
    ["ic", speak`Next contact`, stride.end_s],
  ].map(([kind, label, time]) => eventRow(stride, kind, label, time, { editable, review, onMove, onDelete }));
  const facts = h("p", { class: "small mut num" }, speak`${seconds(stride.end_s - stride.start_s)} s, stance ${stance(stride)} %`);
  const said = stride.used
    ? stride.flags.length ? speak`Included, although a rule excludes it: ${stride.flags.map((flag) => translate(flag.replaceAll("_", " "))).join(", ")}.` : ""
    : stride.excluded_by === "person" ? speak`Excluded manually: ${stride.excluded}.` : speak`Excluded by rule: ${whyOut(stride)}.`;
  const act = stride.used
    ? askWhyOut((reason) => onLeaveOut(stride, reason))
    : h("button", { class: "btn", type: "button", "data-count": true, onclick: () => onCount(stride) }, speak`Include it`);
  return [facts, said ? h("p", { class: "small" }, said) : null, h("div", { class: "tl-fields" }, ...rows.flat()), editable ? act : null].filter(Boolean);
}

// One tap says why and leaves the stride out; words of one's own are asked for.
function askWhyOut(answer) {
  const button = (words, reason, marks = {}) => h("button", { class: "btn", type: "button", ...marks, onclick: () => answer(reason) }, words);
  return h("fieldset", { class: "tl-why" }, h("legend", { class: "small mut" }, speak`Exclude it because`), ...reasons().map((reason) => button(reason, reason, { "data-why": reason })), button(speak`Other…`, "", { "data-out": true }));
}

function eventRow(stride, kind, label, time, { editable, review, onMove, onDelete }) {
  const id = `t-${label.replaceAll(" ", "-").toLowerCase()}`;
  const event = time === null ? null : review.at(stride.side, kind, time);
  if (!event) return [h("span", { class: "small" }, label), h("span", { class: "small dim" }, speak`not found`), h("span")];
  const field = /** @type {HTMLInputElement} */ (h("input", { class: "input num", id, type: "number", step: "0.01", min: 0, value: event.time_s.toFixed(3), readonly: !editable }));
  field.addEventListener("change", () => {
    const to = Number(field.value);
    if (field.value === "" || Math.abs(to - event.time_s) < 0.0005) field.value = event.time_s.toFixed(3);
    else onMove(event, to);
  });
  const remove = editable
    ? h("button", { class: "btn icon ghost", type: "button", "aria-label": speak`Delete ${lowered(label)}`, title: speak`Delete ${lowered(label)}`, onclick: () => onDelete(event) }, icon("trash"))
    : h("span");
  return [h("label", { class: "small", for: id }, label), h("span", { class: "row g2" }, field, h("span", { class: "unit" }, "s")), remove];
}

// The table that says in words and numbers what the drawing above shows.
export function strideRows(review, win, picked, onPick) {
  const seen = review.strides.map((s, i) => [s, i]).filter(([s]) => s.end_s > win.start && s.start_s < win.end);
  const rest = seen.length > LISTED ? speak`; the first ${LISTED} are listed, zoom in for the others` : "";
  const words = speak`${seen.length} of ${review.strides.length}${rest}`;
  const rows = seen.slice(0, LISTED).map(([s, i]) =>
    h(
      "tr",
      { class: i === picked ? "on" : "", "aria-current": i === picked ? "true" : null },
      h("td", {}, chip(s.side)),
      ...[s.start_s, s.tc_s, s.end_s].map((t) => h("td", { class: "n" }, t === null ? "–" : seconds(t))),
      h("td", { class: "n" }, seconds(s.end_s - s.start_s)),
      h("td", { class: "n" }, stance(s)),
      h("td", {}, s.used ? speak`yes` : h("span", { class: "mut" }, speak`no: ${whyOut(s)}`)),
      h("td", { class: "n" }, h("button", { class: "btn sm", type: "button", "aria-label": speak`Open ${translate(s.side)} stride at ${seconds(s.start_s)} s`, onclick: () => onPick(i) }, speak`Open`)),
    ),
  );
  return { words, rows };
}

// Changes that count, the newest first.
export function editRows(review) {
  if (!review.edits.length) return [h("li", { class: "mut" }, speak`None. All events are as detected.`)];
  return review.edits.toReversed().map((e) => {
    const day = new Date(e.at).toLocaleString(document.documentElement.lang === "de" ? "de-DE" : "en-GB", { day: "numeric", month: "short", hour: "2-digit", minute: "2-digit" });
    return h("li", {}, chip(e.side), h("span", {}, what(e, review), h("span", { class: "xs dim block" }, `${e.by ?? speak`unknown`}, ${day}`)));
  });
}

// A stride is kept by its middle, so that moved events lose none, and named by its contact as everywhere else.
function what(e, review) {
  const stride = e.event ? undefined : review.strides.find((s) => s.side === e.side && s.start_s <= e.time_s && e.time_s < s.end_s);
  const at = `${seconds(stride?.start_s ?? e.time_s, 2)} s`;
  if (e.kind === "move_event") return speak`${WORD[e.event]} moved from ${at} to ${seconds(e.to_s, 2)} s`;
  if (e.kind === "add_event") return speak`${WORD[e.event]} added at ${at}`;
  if (e.kind === "delete_event") return speak`${WORD[e.event]} at ${at} deleted`;
  if (e.kind === "exclude_stride") return speak`stride at ${at} excluded: ${e.reason}`;
  return speak`stride at ${at} included`;
}
