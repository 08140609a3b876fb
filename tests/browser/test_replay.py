"""The 3D figure in its frame: shows both legs, follows the clock, comes back after a lost line, goes dark."""

from __future__ import annotations

import base64

from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import Filled, Opener

COUNT = """async (png) => {
  const image = new Image();
  image.src = `data:image/png;base64,${png}`;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [image.width, image.height];
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const d = context.getImageData(0, 0, canvas.width, canvas.height).data;
  const found = { orange: 0, blue: 0, sum: 0 };
  for (let i = 0; i < d.length; i += 4) {
    const [r, g, b] = [d[i], d[i + 1], d[i + 2]];
    found.orange += r > 120 && r > 1.5 * g && g > b ? 1 : 0;
    found.blue += b > 120 && b > 1.5 * r && b > g ? 1 : 0;
    found.sum += r + g + b;
  }
  return { ...found, mean: found.sum / (d.length / 4) / 3 };
}"""
"""Pixels of the left leg's and the right leg's colour, and the mean brightness."""


def test_the_figure_has_two_legs_and_follows_the_clock(
    opened: Opener, solid: Browser, filled: Filled
) -> None:
    page = _open(opened, solid, filled)
    before = _pixels(page)
    assert before["orange"] > 200
    assert before["blue"] > 200
    picture = _picture(page)
    page.keyboard.press("j")
    page.wait_for_function(
        "() => Math.abs(document.querySelector('gait-view').dataset.shown"
        " - document.querySelector('time-bar input').value) < 0.05"
    )
    page.wait_for_timeout(500)
    assert _picture(page) != picture


def test_a_lost_line_comes_back_by_itself(opened: Opener, solid: Browser, filled: Filled) -> None:
    page = _open(opened, solid, filled)
    page.evaluate("document.querySelector('gait-view').socket.close()")
    view = page.locator("gait-view")
    expect(view).to_have_attribute("data-state", "lost")
    expect(view).to_have_attribute("data-state", "open", timeout=10_000)
    page.frame_locator("gait-view iframe").locator("canvas[data-engine]").wait_for(timeout=30_000)
    page.wait_for_timeout(1500)
    assert _pixels(page)["orange"] > 200


def test_the_figure_goes_dark_with_the_page(opened: Opener, solid: Browser, filled: Filled) -> None:
    page = _open(opened, solid, filled)
    light = _pixels(page)["mean"]
    page.locator(".rail [data-theme-toggle]").click()
    page.wait_for_timeout(1500)
    assert light > 200
    assert _pixels(page)["mean"] < 80


def _open(opened: Opener, solid: Browser, filled: Filled) -> Page:
    page = opened(f"/sessions/{filled.done}", browser=solid)
    page.locator("gait-view[data-state=open]").wait_for(timeout=30_000)
    page.frame_locator("gait-view iframe").locator("canvas[data-engine]").wait_for(timeout=30_000)
    page.wait_for_timeout(2000)
    return page


def _picture(page: Page) -> bytes:
    return page.locator("gait-view iframe").screenshot()


def _pixels(page: Page) -> dict[str, float]:
    png = base64.b64encode(_picture(page)).decode()
    found: dict[str, float] = page.evaluate(COUNT, png)
    return found
