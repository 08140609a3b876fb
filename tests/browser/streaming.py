"""A person who walks live: a simulated hemiparetic training, streamed at its own speed as a tablet would."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any
from uuid import uuid4

from playwright.sync_api import Page

from sagittal.core.simulate import Simulation
from sagittal.server.demo import live as demo_live
from sagittal.server.demo.clinic import STROKE
from tests.browser import filling
from tests.browser.conftest import RunningServer
from tests.helpers.kept import keep

LONGER: Mapping[str, Any] = {
    "parameter": "step_length_m",
    "side": "left",
    "target": {"source": "manual", "mean": 0.55, "sd": 0.03},
    "modes": ["bar", "tone", "tick"],
    "schedule": {"kind": "every", "probe_every": 8, "probe_strides": 2, "retention_strides": 0},
    "progression": {"start_level": 0, "worse": "low"},
}
"""Longer steps on the left, told after every stride but for short probe blocks."""


@keep
def _training() -> Simulation:
    return demo_live.plan_training(4)


@contextmanager
def walking(running: RunningServer, prescription: Mapping[str, Any] = LONGER) -> Iterator[str]:
    """Session of a person who walks until stopped."""
    result = _training()
    with running.client() as client:
        patient = filling.add(
            client, "/patients", code=f"LIVE-{uuid4().hex[:4]}", sex="male", birth_year=1968,
            height_m=STROKE.height_m, affected_side="left",
        )  # fmt: skip
        filling.add(client, f"/patients/{patient['id']}/prescriptions", **prescription)
        session = filling.add_session(client, patient["id"], "Training 10, week 5")
        code = filling.add(client, f"/sessions/{session}/live")["code"]
        walk = result.recording
        stream = threading.Thread(target=lambda: asyncio.run(demo_live.stream_walk(running.url, code, walk)))
        stream.start()
        try:
            yield session
        finally:
            with suppress(AssertionError):  # ended by the test already
                filling.add(client, f"/sessions/{session}/live/commands", command="stop")
            stream.join(60)


def until_strides(page: Page, count: int, timeout_s: float = 90) -> None:
    """Wait until the therapist's page has received and shows this many cues."""
    page.wait_for_function(
        "n => (document.querySelector('live-page').feed?.cues.length ?? 0) >= n",
        arg=count,
        timeout=1000 * timeout_s,
    )
    page.wait_for_function("() => document.querySelector('live-page').feed.fresh === true", timeout=30_000)
