// Design tokens as colours that a canvas takes: they hold light-dark(), which only a computed style resolves.

/**
 * @param {Element} element in whose place and scheme the tokens are read
 * @param {string[]} names of the tokens, without the dashes
 * @returns {Record<string, string>} name → rgb()
 */
export function resolveColours(element, names) {
  const probe = document.createElement("span");
  probe.hidden = true;
  element.append(probe);
  /** @type {Record<string, string>} */
  const colours = {};
  for (const name of names) {
    probe.style.color = `var(--${name})`;
    colours[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return colours;
}
