// The last strides as rows: for the strip, and as a table twin for who does not see it.
import { chip, h } from "../common/elements.js";
import { cell } from "./shapes.js";
import { SHOWN } from "./strip.js";
import { withUnit } from "./words.js";
import { speak } from "../common/words.js";

const ZONE = { in: "in", near_low: "near", near_high: "near", low: "away", high: "away" };
const ZONE_WORDS = { in: speak`in the zone`, near_low: speak`just below`, near_high: speak`just above`, low: speak`below`, high: speak`above` };
const WHY = {
  baseline: speak`first strides`, retention: speak`retention test`, off: speak`off`, paused: speak`paused`, stale: speak`no data`, stopped: speak`ended`,
  probe: speak`probe`, faded: speak`faded out`, positive_only: speak`not in the zone`, bandwidth: speak`in the zone`,
};

// What is watched: the prescribed parameter and side, else what the therapist chose, both sides.
export function rowsOf(feed, parameter, prescription) {
  const cues = new Map(feed.cues.map((c) => [c.n, c]));
  const given = prescription?.parameter === parameter ? prescription : null;
  return feed.strides
    .filter((s) => s.counted && (!given?.side || s.side === given.side))
    .map((s) => {
      const cue = given ? cues.get(s.n) : null;
      return {
        n: s.n, side: s.side, value: s.values?.[parameter] ?? null, cue,
        kind: cue ? ZONE[cue.zone] : s.side, cued: Boolean(cue?.shown),
      };
    })
    .filter((r) => r.value !== null || r.cue)
    .slice(-SHOWN);
}

export function fill(body, rows, term) {
  body.replaceChildren(...[...rows].reverse().map((r, i) => {
    const told = !r.cue ? "–" : r.cue.shown ? speak`yes` : speak`no, ${WHY[r.cue.why_not] ?? speak`not shown`}`;
    return h(
      "tr",
      {},
      cell(i === 0 ? speak`now` : speak`${i} ago`, "n"),
      h("td", {}, chip(r.side)),
      cell(withUnit(r.value, term), "n"),
      cell(r.cue ? ZONE_WORDS[r.cue.zone] : "–"),
      cell(told),
    );
  }));
}
