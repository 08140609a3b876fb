// The checks of the design system on a live page; design.py calls them.
({
  // Targets under 44 px, what sticks out of the page or of its card; tables may scroll inside a card.
  layout: () => {
  const small = [], over = [], clip = [];
  for (const e of document.querySelectorAll('a.btn,button,select,input,summary,.item,.tabs a,[role=button],[role=slider],a.tap')) {
    const r = e.getBoundingClientRect();
    if (!r.width || e.closest('label.check, svg, [hidden]') || e.type === 'file') continue;
    let [w, h] = [r.width, r.height];
    for (const p of ['::after', '::before']) {
      const q = getComputedStyle(e, p);
      if (q.content !== 'none' && q.position === 'absolute') {
        h = Math.max(h, parseFloat(q.height) || 0);
        w = Math.max(w, parseFloat(q.width) || 0);
      }
    }
    const word = (e.textContent.trim() || e.getAttribute('aria-label') || e.className).slice(0, 24);
    if (h < 43.5 || (w < 43.5 && !e.matches('a.tap'))) small.push(`${word} ${Math.round(w)}x${Math.round(h)}`);
  }
  for (const g of document.querySelectorAll('svg [role=button]')) {
    const r = g.getBoundingClientRect();
    if (r.width && Math.min(r.width, r.height) < 43.5) small.push(`${g.getAttribute('aria-label')} ${Math.round(r.width)}x${Math.round(r.height)}`);
  }
  // what a screen reader takes as one picture or one button must hold nothing to operate (axe: nested-interactive)
  const nested = [];
  for (const e of document.querySelectorAll('[role=img], button, a[href], [role=button]'))
    if (e.querySelector('a[href], button, input, select, textarea, [tabindex]:not([tabindex="-1"])')) nested.push(`${e.tagName}.${e.getAttribute('class')}`);
  const scrolls = (e) => { for (let b = e; b; b = b.parentElement) if (['auto', 'scroll'].includes(getComputedStyle(b).overflowX)) return true; return false; };
  for (const e of document.querySelectorAll('main *')) {
    if (e.closest('svg, .tabs')) continue;
    const r = e.getBoundingClientRect();
    if (r.width && r.right > innerWidth + 1 && !scrolls(e)) over.push(`${e.tagName}.${e.className}`);
  }
  for (const e of document.querySelectorAll('.card'))
    if (e.scrollWidth > e.clientWidth + 1 && !scrolls(e)) clip.push((e.querySelector('h2') || {}).textContent || e.className);
  return { sideways: Math.max(0, document.documentElement.scrollWidth - innerWidth), small, over, clip, nested };
},
  // Text, also in fields, under WCAG AA contrast (4.5:1, 3:1 from 24 px) or under 11 px, as it is seen: through what is
  // transparent. What is old on a live page is meant to be faint: its cover says so.
  text: () => {
  const lum = (c) => { const f = (v) => { v /= 255; return v <= .04045 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4; }; return .2126 * f(c[0]) + .7152 * f(c[1]) + .0722 * f(c[2]); };
  const rgb = (s) => { const m = s.match(/[\d.]+/g); return m ? m.map(Number) : null; };
  const over = (top, share, below) => below.map((v, i) => share * top[i] + (1 - share) * v);
  // what is behind an element, and through how much of it that is seen, asked once: texts of a table share it
  const grounds = new Map([[null, { behind: [255, 255, 255], ground: [255, 255, 255], seen: 1 }]]);
  const groundOf = (e) => {
    if (!grounds.has(e)) {
      const cs = getComputedStyle(e), c = rgb(cs.backgroundColor), up = groundOf(e.parentElement), fades = Number(cs.opacity);
      const own = c ? over(c, c[3] ?? 1, up.ground) : up.ground;
      // what fades does so with all that is in it, over what was there before
      grounds.set(e, fades < 1 ? { behind: up.ground, ground: own, seen: up.seen * fades } : { behind: up.behind, ground: own, seen: up.seen });
    }
    return grounds.get(e);
  };
  const bad = {};
  const look = (e, text, cs, colour) => {
    const fg = rgb(colour);
    if (!fg) return;
    const { behind, ground, seen } = groundOf(e);
    const shown = [over(fg, fg[3] ?? 1, ground), ground].map((c) => over(c, seen, behind));
    const [hi, lo] = shown.map(lum).sort((p, q) => q - p), ratio = (hi + .05) / (lo + .05);
    const size = parseFloat(cs.fontSize), big = size >= 24 || (size >= 18.66 && +cs.fontWeight >= 600);
    const name = e.className.baseVal ?? e.className;
    if (ratio < (big ? 3 : 4.5) - .005) bad[`${name} contrast ${ratio.toFixed(2)}`] = text.slice(0, 24);
    if (size < 10.9) bad[`${name} size ${size}`] = text.slice(0, 24);
  };
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const text = walk.currentNode.textContent.trim(), e = walk.currentNode.parentElement;
    if (!text || !e.getClientRects().length || e.closest('title,desc,.vh,.skip,.stale,[disabled],[aria-disabled=true],option,script,style')) continue;
    const cs = getComputedStyle(e);
    look(e, text, cs, e.namespaceURI.includes('svg') ? cs.fill : cs.color);
  }
  for (const e of document.querySelectorAll('textarea, select, input:not([type=checkbox], [type=radio], [type=range], [type=file])')) {
    if (!e.getClientRects().length || e.disabled) continue;
    const cs = getComputedStyle(e);
    if (e.value) look(e, e.value, cs, cs.color);
    else if (e.placeholder) look(e, e.placeholder, cs, getComputedStyle(e, '::placeholder').color);
  }
  return bad;
},
})
