"""The figure in a real browser, through the authenticated proxy, inside an iframe of our own page."""

from __future__ import annotations

import asyncio
import io
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from server.viewer.colours import TINTS
from tests.server.viewer.conftest import Ward

CHROMIUM = Path("/usr/bin/chromium")
ARGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
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


@pytest.fixture(scope="module")
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    """An event loop in a thread of its own: playwright's synchronous interface owns this one."""
    running = asyncio.new_event_loop()
    thread = threading.Thread(target=running.run_forever, daemon=True)
    thread.start()
    yield running
    running.call_soon_threadsafe(running.stop)
    thread.join()
    running.close()


@pytest.fixture(scope="module")
def served(loop: asyncio.AbstractEventLoop, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ward]:
    from tests.server.viewer.conftest import open_ward

    ward = open_ward(tmp_path_factory.mktemp("clinic"))
    yield asyncio.run_coroutine_threadsafe(ward.__aenter__(), loop).result(30)
    asyncio.run_coroutine_threadsafe(ward.__aexit__(None, None, None), loop).result(30)


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
        shot = _until_drawn(page.locator("iframe"), dark)
        panel = frame.locator(".mantine-Paper-root")
        assert panel.count() > 0  # viser still calls it so, and we hide it
        assert not panel.first.is_visible()
        assert refused == []
        browser.close()
    corner = shot[5, 5].astype(int)
    assert (corner.mean() < 60) == dark


def _until_drawn(frame: object, dark: bool) -> np.ndarray:
    """Pictures of the frame until both leg colours fill more than a leg's share of it, or fail."""
    counts: dict[str, int] = {}
    for _ in range(60):
        png = frame.screenshot()  # type: ignore[attr-defined]
        shot = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
        counts = {side: _pixels_of(shot, TINTS[dark][side]) for side in ("left", "right")}
        if min(counts.values()) > 800:
            return shot
    raise AssertionError(f"leg colours were not drawn: {counts}")


def _pixels_of(shot: np.ndarray, rgb: tuple[int, int, int]) -> int:
    """Pixels of this hue, whatever the light does to their brightness."""
    colour = np.asarray(rgb, float) / np.linalg.norm(rgb)
    pixels = shot.reshape(-1, 3).astype(float)
    length = np.linalg.norm(pixels, axis=1)
    return int(np.sum((length > 60) & (pixels @ colour > 0.97 * length)))
