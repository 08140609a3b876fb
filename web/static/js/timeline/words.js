// Events and times as the parts of the timeline write them.
export const WORD = { ic: "contact", tc: "foot-off" };

// Seconds with a real minus, as many decimals as a sample needs.
export const seconds = (t, digits = 2) => t.toFixed(digits).replace("-", "−");
