// The card of the last 20 strides: which parameter, the strip, how many in the zone, left against right, the table.
import "./strip.js";
import { SHOWN } from "./strip.js";
import { fill, rowsOf } from "./strides-table.js";
import { asymmetry, say } from "./words.js";
import { lowered, speak, translate } from "../common/words.js";

export class StripCard {
  constructor(root, data, feed) {
    this.root = root;
    this.data = data;
    this.feed = feed;
    this.strip = root.querySelector("target-strip");
    this.choice = root.querySelector("[data-strip-of]");
    for (const name of data.choices) this.choice.add(new Option(data.terms[name].label, name));
    this.choice.addEventListener("change", () => { this.parameter = this.choice.value; this.what(); this.changed(); });
  }

  // The prescribed parameter; without one the therapist chooses what to watch.
  given() {
    const given = this.data.prescription;
    this.parameter = given?.parameter ?? this.choice.value;
    this.choice.hidden = Boolean(given);
    this.what();
  }

  get term() { return this.data.terms[this.parameter]; }

  what() {
    const side = this.data.prescription?.side;
    const unit = this.term?.unit ? `, ${this.term.unit}` : "";
    say(this.root.querySelector("[data-strip-what]"), this.data.prescription ? `${(this.term ? lowered(this.term.label) : this.parameter)}${side ? `, ${translate(side)}` : ""}${unit}` : "");
    this.changed();
  }

  state(state, next) {
    this.now = state;
    say(this.root.querySelector("[data-strip-words]"), next);
    this.changed();
  }

  zone(rows) {
    const cue = rows.findLast((r) => r.cue)?.cue;
    const from = this.now?.zone_low !== undefined && this.now?.zone_low !== null ? this.now : cue;
    return from ? [from.zone_low, from.zone_high] : null;
  }

  changed() {
    const rows = rowsOf(this.feed, this.parameter, this.data.prescription);
    this.strip.show(rows, this.data.prescription ? this.zone(rows) : null, this.term?.digits ?? 2);
    const judged = rows.filter((r) => r.cue), inside = judged.filter((r) => r.kind === "in").length;
    say(this.root.querySelector("[data-in-zone]"), judged.length ? speak`${inside} of ${judged.length} in zone` : "");
    const of = (side) => this.feed.strides.filter((s) => s.counted && s.side === side).slice(-SHOWN / 2).map((s) => s.values?.[this.parameter]);
    say(this.root.querySelector("[data-asymmetry]"), asymmetry(of("left"), of("right"), this.term) ?? "");
    if (!this.root.querySelector("#strides-table").hidden) fill(this.root.querySelector("tbody"), rows, this.term);
    this.rows = rows;
  }

  table(button) {
    const shown = button.ariaPressed !== "true";
    button.ariaPressed = String(shown);
    this.root.querySelector("#strides-table").hidden = !shown;
    this.strip.hidden = shown;
    this.changed();
  }
}
