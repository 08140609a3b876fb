// Events and times as the parts of the timeline write them.
import { localise, speak, translate } from "../common/words.js";

export const WORD = { ic: speak`contact`, tc: speak`foot-off` };

// Seconds with a real minus, as many decimals as a sample needs.
export const seconds = (t, digits = 2) => localise(t.toFixed(digits).replace("-", "−"));

// Why a stride does not count: the words of a person as they are, those of a rule in the language of the page.
export const whyOut = (stride) => (stride.excluded_by === "person" ? stride.excluded : translate(stride.excluded));
