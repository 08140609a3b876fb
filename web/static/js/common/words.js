// Words as all pages write them. The texts of the scripts in the language of the page. English stands in the sources, marked by the tag `speak`;
// another language is a catalogue that the page names: English with {0}, {1} … for values → the language.

const LANGUAGE = document.documentElement.lang || "en";
const address = document.documentElement.dataset.texts;

/** @type {Record<string, string>} */
const CATALOGUE = address ? await fetch(address).then((answer) => answer.json(), () => ({})) : {};

const OWN_WORDS = /^(kind|label|protocol)\d*$/; // as web/language.py tells what people typed or uploaded
const IDENTIFIERS = /^(by|column|device|device_id|duplicate_of|file|file_name|ids)\d*$/;
const QUOTED = /“((?:[^“”]|“[^“”]*”)*)”/gu;
const OWN_QUOTATIONS = new Set(Object.keys(CATALOGUE).flatMap((message) => [...message.matchAll(QUOTED)].map(([, quoted]) => quoted)));
const FIRST_MASK = 0xe000;

/**
 * Placeholders of a message that hold user text: those in quotation marks, and identifiers.
 * @param {string[]} pieces literals and names in turn
 */
function typedOf(pieces) {
  const isTyped = (name, i) => IDENTIFIERS.test(name) || (!OWN_WORDS.test(name) && /['“]$/.test(pieces[i - 1]) && /^['”]/.test(pieces[i + 1]));
  return new Set(pieces.filter((piece, i) => i % 2 && isTyped(piece, i)));
}

const PLACEHOLDER = /\{(\w*)\}/;
const PATTERNS = Object.entries(CATALOGUE).filter(([message]) => PLACEHOLDER.test(message)).map(([message, said]) => {
  const pieces = message.split(PLACEHOLDER);
  const literals = pieces.filter((_, i) => i % 2 === 0);
  const escaped = literals.map((piece) => piece.replace(/[\\^$.*+?()[\]{}|]/g, "\\$&"));
  return {
    said, names: pieces.filter((_, i) => i % 2), typed: typedOf(pieces), form: new RegExp(`^${escaped.join("(.+?)")}$`, "s"),
    words: literals.reduce((sum, piece) => sum + piece.trim().length, 0),
  };
}).sort((a, b) => b.words - a.words); // of two that fit, the one with more words of its own
const FOLDED = new Map(Object.entries(CATALOGUE).map(([message, said]) => [message.toLowerCase(), said]));
const WORDY = /\p{L}{3}.*\s\p{L}{3}.*\s\p{L}{3}/su; // a sentence that nobody knows, a citation: as it is
const DAY = /^(\d{1,2}) (Jan|Feb|Mar|Apr|May|Jun|Jul|Aug|Sep|Oct|Nov|Dec) (\d{4})$/; // as the server writes it
const SOURCED = /^(.+?)((?:, n = \d+)? \(.+\))$/s; // people, how many, and who measured them
const MARK = new Intl.NumberFormat(LANGUAGE).format(0.5)[1];

/** @param {string} said @param {Record<string, string>} values */
const fill = (said, values) => said.replace(/\{(\w*)\}/g, (whole, name) => values[name] ?? whole);

/**
 * Numbers inside a text with the decimal mark of the language.
 * @param {string} value
 */
export const localise = (value) => (MARK === "." ? value : value.replace(/(?<![\w.,])(\d+)\.(\d+)(?![\d.])/g, `$1${MARK}$2`));

/**
 * A number with so many decimals and the decimal mark of the language.
 * @param {number} value
 * @param {number} digits
 */
export const fixed = (value, digits) => localise(value.toFixed(digits));

/**
 * What the server said, in the language of the page: a message of the catalogue, or a sentence that was
 * made from one; all else stays as it is, numbers apart.
 * @param {string} value
 * @returns {string}
 */
export function translate(value) {
  if (!address || !value) return value;
  const before = SAID.get(value);
  if (before !== undefined) return before;
  if (SAID.size >= MOST_SAID) SAID.clear();
  const found = findAround(value);
  SAID.set(value, found);
  return found;
}

/**
 * A sentence whose quotations stay as they are.
 * @param {string} value
 */
function findAround(value) {
  const kept = [];
  const masked = value.replace(QUOTED, (whole, quoted) => (OWN_QUOTATIONS.has(quoted) ? whole : `“${String.fromCharCode(FIRST_MASK + kept.push(quoted) - 1)}”`));
  const [open, close] = LANGUAGE === "de" ? "„“" : "“”";
  return kept.reduce((said, quoted, i) => {
    const mask = String.fromCharCode(FIRST_MASK + i);
    return said.replaceAll(`“${mask}”`, `${open}${mask}${close}`).replaceAll(mask, () => quoted);
  }, find(masked).replaceAll("”, “", `${close}, ${open}`)); // a list of them in one placeholder
}

const SAID = new Map(); // live pages say the same many times a second
const MOST_SAID = 2000;

/** @param {string} value */
function find(value) {
  if (!/\p{L}{2}/u.test(value)) return localise(value);
  const inner = value.trim();
  if (DAY.test(inner)) {
    const day = new Date(`${inner} 00:00`);
    return value.replace(inner, day.toLocaleDateString(LANGUAGE, { day: "2-digit", month: "2-digit", year: "numeric" }));
  }
  const known = CATALOGUE[inner] ?? recase(inner, FOLDED.get(inner.toLowerCase()));
  if (known !== undefined) return value.replace(inner, () => known);
  for (const { said, names, typed, form } of PATTERNS) {
    const found = form.exec(inner);
    const say = (name, i) => (typed.has(name) ? found[i + 1] : translate(found[i + 1]));
    if (found) return value.replace(inner, () => fill(said, Object.fromEntries(names.map((name, i) => [name, say(name, i)]))));
  }
  const [, said, source] = SOURCED.exec(inner) ?? [];
  if (said && CATALOGUE[said]) return value.replace(inner, () => CATALOGUE[said] + source);
  const sentences = inner.split(/(?<=[.!?…])\s+(?=[A-Z0-9“])/);
  return sentences.length > 1 ? sentences.map(translate).join(" ") : WORDY.test(value) ? value : localise(value);
}

/** @param {string} value @param {string | undefined} said */
const recase = (value, said) => (said && /^\p{Lu}/u.test(value) ? said[0].toUpperCase() + said.slice(1) : said);

/**
 * The tag of every text for people: speak`Sensor ${n} is ready`. Numbers are localised; strings are in the language of the page
 * already, or were typed or uploaded by people, and stay as they are: what the server sent goes through `translate` before.
 * @param {TemplateStringsArray} strings
 * @param {...any} values
 * @returns {string}
 */
export function speak(strings, ...values) {
  const shown = values.map((value) => (typeof value === "number" ? localise(String(value)) : String(value)));
  if (!address) return strings.reduce((said, piece, i) => said + shown[i - 1] + piece);
  const message = strings.reduce((said, piece, i) => `${said}{${i - 1}}${piece}`);
  const inner = message.trim();
  return message.replace(inner, () => fill(CATALOGUE[inner] ?? inner, Object.fromEntries(shown.map((value, i) => [String(i), value]))));
}

const RULES = new Intl.PluralRules(LANGUAGE);

/**
 * The wording of one thing, or of any other number of them.
 * @param {number} count
 * @param {string} one
 * @param {string} many
 */
export const plural = (count, one, many) => (RULES.select(count) === "one" ? one : many);

/**
 * The name of a value inside a sentence: small in English, as it is where nouns are written with a capital.
 * @param {string} name
 */
export const lowered = (name) => (LANGUAGE === "de" ? name : name.toLowerCase());

/** @typedef {"left" | "right"} Side */

export const SIDE_KEY = { left: "l", right: "r" }; // in classes and in names of angles
export const SIDE_LETTER = { left: "L", right: "R" };

/**
 * The side of a segment, left of "thigh_l"; null in the middle of the body.
 * @param {string | null | undefined} segment
 * @returns {Side | null}
 */
export const sideOf = (segment) => (segment?.endsWith("_l") ? "left" : segment?.endsWith("_r") ? "right" : null);
/**
 * The name of a segment without its side, "thigh" of "Left thigh".
 * @param {string} name
 */
export const withoutSide = (name) => name.replace(/^(Left|Right) | (links|rechts)$/, "");

/** @param {string} text */
export const capitalise = (text) => (text ? text[0].toUpperCase() + text.slice(1) : "");

/**
 * Minutes and seconds, "02:07".
 * @param {number | null | undefined} seconds
 * @param {number} [digits] of the minutes at least
 */
export function formatClock(seconds, digits = 2) {
  const s = Math.max(0, Math.floor(seconds ?? 0));
  return `${String(Math.floor(s / 60)).padStart(digits, "0")}:${String(s % 60).padStart(2, "0")}`;
}
