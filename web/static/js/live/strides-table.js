// The last strides as rows: for the strip, and as a table twin for who does not see it.
import { chip, h } from "../common/elements.js";
import { cell } from "./shapes.js";
import { SHOWN } from "./strip.js";
import { withUnit } from "./words.js";

const ZONE = { in: "in", near_low: "near", near_high: "near", low: "away", high: "away" };
const ZONE_WORDS = { in: "in the zone", near_low: "just below", near_high: "just above", low: "below", high: "above" };
const WHY = {
  baseline: "first strides", retention: "retention test", off: "off", paused: "paused", stale: "no data", stopped: "ended",
  probe: "probe", faded: "faded out", positive_only: "not in the zone", bandwidth: "in the zone",
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
    const told = !r.cue ? "–" : r.cue.shown ? "yes" : `no, ${WHY[r.cue.why_not] ?? "not shown"}`;
    return h(
      "tr",
      {},
      cell(i === 0 ? "now" : `${i} ago`, "n"),
      h("td", {}, chip(r.side)),
      cell(withUnit(r.value, term), "n"),
      cell(r.cue ? ZONE_WORDS[r.cue.zone] : "–"),
      cell(told),
    );
  }));
}
