"""Wait for the content of the 3D view's frame, independent of rendering speed."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

from playwright.sync_api import Error, Page

PATIENCE_S = 40.0
"""A picture of the figure takes a second where software draws it, more beside other tests."""

COUNT = """async (png) => {
  const image = new Image();
  image.src = `data:image/png;base64,${png}`;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [image.width, image.height];
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const d = context.getImageData(0, 0, canvas.width, canvas.height).data;
  const found = { orange: 0, blue: 0, sum: 0, x: 0 };
  for (let i = 0; i < d.length; i += 4) {
    const [r, g, b] = [d[i], d[i + 1], d[i + 2]];
    const left = r > 120 && r > 1.5 * g && g > b, right = b > 120 && b > 1.5 * r && b > g;
    found.orange += left ? 1 : 0;
    found.blue += right ? 1 : 0;
    found.x += left || right ? ((i / 4) % canvas.width) / canvas.width : 0;
    found.sum += r + g + b;
  }
  return { ...found, x: found.x / (found.orange + found.blue), mean: found.sum / (d.length / 4) / 3 };
}"""
"""Pixels of the left and of the right leg's colour, where they are across (0 to 1), the mean brightness."""

DRAWN = """() => new Promise(done => {
  let left = 3;
  const next = () => {
    if (!left--) return done();
    requestAnimationFrame(next);
    window.drawNow?.();
  };
  next();
})"""
"""Three frames later, at once (conftest.py, PACED): a message is taken in one, drawn in the next."""


def wait_for_picture(page: Page, expected: Callable[[Mapping[str, float]], bool]) -> dict[str, float]:
    """Take screenshots of the frame until its colours match, and return the result of `COUNT`.

    Raises
    ------
    AssertionError
        no match within `PATIENCE_S`; the message gives the last colours.
    """
    end = time.monotonic() + PATIENCE_S
    while True:
        result: dict[str, float] = page.evaluate(COUNT, base64.b64encode(take_picture(page)).decode())
        if expected(result):
            return result
        assert time.monotonic() < end, result
        page.wait_for_timeout(50)


def wait_until_still(page: Page) -> dict[str, float]:
    """Wait until the frame shows a figure and two pictures in a row are the same; its colours."""
    before: dict[str, float] = {}

    def is_still(found: Mapping[str, float]) -> bool:
        nonlocal before
        same = found == before
        before = dict(found)
        return same and min(found["orange"], found["blue"]) > 0

    return wait_for_picture(page, is_still)


def take_picture(page: Page) -> bytes:
    """PNG of the replay or live frame once all drawing commands are done."""
    frame = page.locator("gait-view iframe, live-view iframe")
    with suppress(Error):  # a frame that is just loading has drawn nothing yet
        inside = frame.element_handle(timeout=1000).content_frame()
        if inside is not None:
            inside.evaluate(DRAWN)
    return frame.screenshot()
