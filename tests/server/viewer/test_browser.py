"""The figure in a real browser, through the authenticated proxy, inside an iframe of our own page."""

from __future__ import annotations

import pytest

from tests.server.viewer.conftest import Ward
from tests.server.viewer.seeing import ARGS, CHROMIUM, until

OPEN = """async ([sid, dark]) => new Promise((done, fail) => {
  const socket = new WebSocket(`ws://${location.host}/sessions/${sid}/replay?tab=browser`);
  window.cursor = socket;
  socket.onerror = () => fail("no replay");
  socket.onmessage = (e) => {
    const message = JSON.parse(e.data);
    if (message.src) {
      const frame = document.createElement("iframe");
      frame.title = "3D"; frame.width = 640; frame.height = 480; frame.src = message.src;
      document.body.replaceChildren(frame);
      socket.send(JSON.stringify({ dark }));
    } else if (message.dark !== undefined) { socket.send(JSON.stringify({ t: 4.45 })); }
    else { done(message.t); }
  };
})"""


@pytest.mark.browser
@pytest.mark.skipif(not CHROMIUM.exists(), reason=f"no browser: {CHROMIUM} is not installed")
@pytest.mark.parametrize("dark", [False, True])
def test_both_legs_are_seen_in_an_iframe(served: Ward, dark: bool) -> None:
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=str(CHROMIUM), args=ARGS)
        context = browser.new_context(viewport={"width": 700, "height": 560})
        context.add_cookies(
            [{"name": "sid", "value": served.clinic.token("clinician"), "domain": "127.0.0.1", "path": "/"}]
        )
        page = context.new_page()
        refused: list[str] = []
        page.on("console", lambda m: refused.append(m.text) if "Content Security Policy" in m.text else None)
        page.goto(f"http://127.0.0.1:{served.port}/account", wait_until="domcontentloaded")
        assert page.evaluate(OPEN, [served.session_id, dark]) == pytest.approx(4.44, abs=0.021)
        frame = page.frame_locator("iframe")
        frame.locator("canvas").first.wait_for(timeout=20_000)
        shot = until(page.locator("iframe"), lambda n: min(n.values()) > 800, dark)
        for _ in range(40):  # the background is a picture, which may come a moment after the figure
            if (shot[5, 5].mean() < 60) == dark:
                break
            shot = until(page.locator("iframe"), lambda n: min(n.values()) > 800, dark)
        panel = frame.locator(".mantine-Paper-root")
        assert panel.count() > 0  # viser still calls it so, and we hide it
        assert not panel.first.is_visible()
        assert refused == []
        browser.close()
    corner = shot[5, 5].astype(int)
    assert (corner.mean() < 60) == dark
