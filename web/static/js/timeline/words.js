// Events and times as the parts of the timeline write them.
import { localise, speak } from "../common/words.js";

export const WORD = { ic: speak`contact`, tc: speak`foot-off` };

// Seconds with a real minus, as many decimals as a sample needs.
export const seconds = (t, digits = 2) => localise(t.toFixed(digits).replace("-", "−"));
