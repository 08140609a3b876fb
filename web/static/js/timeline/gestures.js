// What fingers, mouse and wheel do to the stretch of time that is shown.
const SLACK_PX = 4;

export function timeAt(e, host, win) {
  const box = host.getBoundingClientRect();
  return win.start + ((e.clientX - box.left) / box.width) * win.span;
}

// A drag moves the window, two fingers zoom; a click that is neither goes, as a time, to who asked.
export function drag(host, win, onClick) {
  const fingers = new Map();
  let moved = false;
  host.addEventListener("pointerdown", (e) => {
    if (e.button !== 0) return;
    fingers.set(e.pointerId, e.clientX);
    moved = fingers.size > 1;
  });
  host.addEventListener("pointermove", (e) => {
    if (!fingers.has(e.pointerId)) return;
    const by = e.clientX - fingers.get(e.pointerId);
    if (!moved && Math.abs(by) < SLACK_PX) return;
    if (!host.hasPointerCapture(e.pointerId)) host.setPointerCapture(e.pointerId); // not before: it would take the click
    moved = true;
    if (fingers.size === 1) win.pan((-by / host.clientWidth) * win.span);
    else {
      const other = [...fingers].find(([id]) => id !== e.pointerId)[1];
      const [was, is] = [Math.abs(fingers.get(e.pointerId) - other), Math.abs(e.clientX - other)];
      if (is > 2 * SLACK_PX) win.zoom(was / is, timeAt({ clientX: (e.clientX + other) / 2 }, host, win));
    }
    fingers.set(e.pointerId, e.clientX);
  });
  const end = (e) => {
    if (fingers.delete(e.pointerId) && !moved && e.type === "pointerup") onClick(timeAt(e, host, win));
  };
  for (const name of ["pointerup", "pointercancel", "pointerleave"]) host.addEventListener(name, end);
}

// Press and move along an overview; the place is given as a share of its width.
export function follow(host, act) {
  const go = (e) => act((e.clientX - host.getBoundingClientRect().left) / host.clientWidth);
  host.addEventListener("pointerdown", (e) => {
    if (e.button !== 0) return;
    host.setPointerCapture(e.pointerId);
    go(e);
  });
  host.addEventListener("pointermove", (e) => host.hasPointerCapture(e.pointerId) && go(e));
}

// With Ctrl (or a pinch) the wheel zooms, sideways it moves; else the page scrolls.
export function wheel(e, win) {
  const plot = e.target.closest(".tl-plot");
  const sideways = Math.abs(e.deltaX) > Math.abs(e.deltaY) || e.shiftKey;
  if (!plot || (!e.ctrlKey && !sideways)) return;
  e.preventDefault();
  if (e.ctrlKey) win.zoom(Math.exp(e.deltaY / 300), timeAt(e, plot, win));
  else win.pan(((e.deltaX || e.deltaY) / plot.clientWidth) * win.span);
}
