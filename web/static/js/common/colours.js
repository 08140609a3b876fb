// Design tokens as colours that a canvas takes: they hold light-dark(), which only a computed style resolves.
export function resolveColours(element, names) {
  const probe = document.createElement("span");
  probe.hidden = true;
  element.append(probe);
  const colours = {};
  for (const name of names) {
    probe.style.color = `var(--${name})`;
    colours[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return colours;
}
