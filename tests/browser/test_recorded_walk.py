"""The walk as one HTML file, opened from a folder by a browser without a network."""

from __future__ import annotations

import base64
import time
from pathlib import Path

from playwright.sync_api import Browser

from sagittal.server.viewer.recorded_walk import record_walk
from tests.browser.picture import COUNT, PATIENCE_S
from tests.server import walk


def test_the_figure_walks_without_a_server(solid: Browser, tmp_path: Path) -> None:
    file = tmp_path / "walk.html"
    file.write_bytes(record_walk(walk.poses(60.0)))
    context = solid.new_context(offline=True, viewport={"width": 320, "height": 480})
    try:
        page = context.new_page()
        requested_names: list[str] = []
        page.on("request", lambda r: requested_names.append(r.url))
        page.goto(file.as_uri())
        end = time.monotonic() + PATIENCE_S
        evaluation = {"orange": 0.0, "blue": 0.0}
        while min(evaluation["orange"], evaluation["blue"]) < 100 and time.monotonic() < end:
            evaluation = page.evaluate(COUNT, base64.b64encode(page.screenshot()).decode())
        assert min(evaluation["orange"], evaluation["blue"]) >= 100, evaluation
        assert [url for url in requested_names if not url.startswith(("file:", "data:", "blob:"))] == []
        assert page.title() == "Sagittal"
    finally:
        context.close()
