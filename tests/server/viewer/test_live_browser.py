"""The live figure in a real browser: it moves when pictures come, and turns grey when they stop."""

from __future__ import annotations

import asyncio
import itertools
import threading

import numpy as np
import pytest

from sagittal.core.frames import SIDES
from sagittal.server.viewer.colours import TINTS
from tests.server.viewer.conftest import Ward
from tests.server.viewer.pictures import POSES, picture
from tests.server.viewer.seeing import ARGS, CHROMIUM, PATIENCE_MS, pixels_of, shot, until

OPEN = """async (sid) => {
  const answer = await fetch(`/sessions/${sid}/live/figure?dark=false`);
  const frame = document.createElement("iframe");
  frame.title = "3D"; frame.width = 640; frame.height = 480; frame.src = (await answer.json()).src;
  document.body.replaceChildren(frame);
}"""
EVERY_S = 0.1
STAYS_PX = 1000
"""Pixels of a side's print and trail at most; a leg has far more beside them."""


class Walking:
    """Feed frames of the walk to a session until stopped, at the pace of a software renderer."""

    def __init__(self, ward: Ward, loop: asyncio.AbstractEventLoop) -> None:
        self._stop = threading.Event()
        self._done = asyncio.run_coroutine_threadsafe(self._walk(ward), loop)

    async def _walk(self, ward: Ward) -> None:
        room = ward.clinic.app.state.hub.room(ward.session_id)
        for i in itertools.cycle(range(0, len(POSES.t_s), 2)):
            if self._stop.is_set():
                return
            room.show(picture(i))
            await asyncio.sleep(EVERY_S)

    def stop(self) -> None:
        self._stop.set()
        self._done.result(10)


@pytest.mark.browser
@pytest.mark.skipif(not CHROMIUM.exists(), reason=f"no browser: {CHROMIUM} is not installed")
def test_both_legs_move_while_pictures_come_and_lose_their_colours_when_they_stop(
    served: Ward, loop: asyncio.AbstractEventLoop
) -> None:
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=str(CHROMIUM), args=ARGS)
        context = browser.new_context(viewport={"width": 700, "height": 560})
        context.add_cookies(
            [{"name": "sid", "value": served.clinic.token("clinician"), "domain": "127.0.0.1", "path": "/"}]
        )
        page = context.new_page()
        page.goto(f"http://127.0.0.1:{served.port}/account", wait_until="domcontentloaded")
        page.evaluate(OPEN, served.session_id)
        frame = page.locator("iframe")
        page.frame_locator("iframe").locator("canvas").first.wait_for(timeout=PATIENCE_MS)
        # somebody stands there, in no side's colour
        until(frame, lambda n: max(n.values()) < 50)
        walking = Walking(served, loop)
        try:
            until(frame, lambda n: min(n.values()) > STAYS_PX)
            shots = [shot(frame) for _ in range(4)]
        finally:
            walking.stop()
        until(frame, lambda n: max(n.values()) < STAYS_PX)
        browser.close()
    for side in SIDES:
        masks = [pixels_of(x, TINTS[False][side]) for x in shots]
        moved = [int(np.sum(a ^ b)) for a, b in itertools.pairwise(masks)]
        assert max(moved) > 300, (side, moved)
