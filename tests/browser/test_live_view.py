"""The live figure's frame on the therapist's page: loaded once it is seen, and again when it has to be."""

from __future__ import annotations

from collections.abc import Callable
from uuid import uuid4

from playwright.sync_api import Browser, Page, expect

from tests.browser import filling
from tests.browser.conftest import RunningServer
from tests.browser.feed import Told

LOADS_MS = 60_000


def test_the_figure_is_loaded_again_when_the_line_comes_back_and_when_the_theme_changes(
    flat: Browser, running: RunningServer, cookies: list[dict[str, str]]
) -> None:
    with running.client() as client:
        patient = filling.add(client, "/patients", code=f"VIEW-{uuid4().hex[:6]}", height_m=1.7)["id"]
        session = filling.add_session(client, patient, "Training 10")
    context = flat.new_context(base_url=running.url, color_scheme="light")
    context.add_cookies(cookies)  # type: ignore[arg-type]
    page = context.new_page()
    requested_names: list[str] = []
    page.on("request", lambda r: requested_names.append(r.url) if "/live/figure" in r.url else None)
    this = Told.of(page)
    page.goto(f"/sessions/{session}/live")
    _until(page, lambda: bool(this.routes))
    assert requested_names == []  # the figure is not to be seen yet
    this.walk([0.53], ["in"])
    view, frame = page.locator("live-view"), page.locator("live-view iframe")
    expect(view).to_have_attribute("data-state", "open", timeout=LOADS_MS)
    light = frame.get_attribute("src")
    assert [url.endswith("dark=false") for url in requested_names] == [True]

    this.routes[-1].close()
    _until(page, lambda: len(requested_names) == 2)
    expect(view).to_have_attribute("data-state", "open", timeout=LOADS_MS)
    assert frame.get_attribute("src") == light  # the same view, loaded anew

    page.evaluate("() => { document.documentElement.dataset.theme = 'dark'; }")
    _until(page, lambda: len(requested_names) == 3)
    expect(view).to_have_attribute("data-state", "open", timeout=LOADS_MS)
    assert requested_names[-1].endswith("dark=true")
    assert frame.get_attribute("src") != light
    context.close()


def _until(page: Page, done: Callable[[], bool]) -> None:
    for _ in range(200):
        if done():
            return
        page.wait_for_timeout(50)
    raise AssertionError("it did not come to this")
