"""Guided timed up and go from pairing to the session page, streamed as by a tablet."""

from __future__ import annotations

import asyncio
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from uuid import uuid4

import numpy as np
import pytest
from playwright.sync_api import expect

from sagittal.core.signals.recording import ImuStream
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.simulate.tug import ChairSimulation, simulate_tug
from sagittal.server.demo import live as demo_live
from tests.browser import filling
from tests.browser.conftest import Opener, RunningServer
from tests.helpers.kept import keep

SITS_ON_S = 60.0
"""The person stays on the chair until the therapist has seen the result."""


@keep
def up_and_go() -> ChairSimulation:
    """Simulated test with one pelvis sensor, followed by long sitting."""
    simulation = simulate_tug("healthy", 1, setup=replace(ON_SKIN, worn=("pelvis",)))
    streams = {device: _held(x) for device, x in simulation.recording.streams.items()}
    return replace(simulation, recording=replace(simulation.recording, streams=streams))


def _held(x: ImuStream) -> ImuStream:
    n, more = len(x.t_s), round(SITS_ON_S * x.rate_hz)
    index = np.concatenate((np.arange(n), np.resize(np.arange(n - 50, n), more)))
    t_s = x.t_s[0] + np.arange(n + more) / x.rate_hz
    mag = None if x.mag is None else x.mag[index]
    return replace(x, t_s=t_s, acc=x.acc[index], gyr=None if x.gyr is None else x.gyr[index], mag=mag)


@contextmanager
def somebody_who_does_it(running: RunningServer) -> Iterator[str]:
    """Session of a person who performs the test."""
    take = up_and_go().recording
    with running.client() as client:
        user = {"code": f"TUG-{uuid4().hex[:4]}", "sex": "female", "birth_year": 1958, "height_m": 1.65}
        patient = filling.add(client, "/patients", **user)
        session = filling.add_session(client, patient["id"], "Up and go", protocol="tug")
        code = filling.add(client, f"/sessions/{session}/live")["code"]
        stream = threading.Thread(target=lambda: asyncio.run(demo_live.stream_walk(running.url, code, take)))
        stream.start()
        try:
            yield session
        finally:
            with suppress(AssertionError):  # ended by the test already
                filling.add(client, f"/sessions/{session}/live/commands", command="stop")
            stream.join(60)


@pytest.mark.slow
def test_a_guided_up_and_go_is_timed_corrected_kept_and_analysed(
    opened: Opener, running: RunningServer
) -> None:
    true_s = up_and_go().truth.duration_s
    with somebody_who_does_it(running) as session:
        page = opened(f"/sessions/{session}/live")
        test = page.locator("live-test")
        expect(page.locator("live-page")).to_have_attribute("data-view", "test", timeout=60_000)
        expect(test.locator("[data-phase]").first).to_have_text("Running", timeout=90_000)
        expect(test.locator("[data-say]")).to_contain_text("walk back, sit down")
        expect(test.locator("[data-clock]")).not_to_have_text("0.0")

        # it stops by itself, and the result is there at once
        expect(test.locator("[data-result]")).to_be_visible(timeout=60_000)
        assert float(test.locator("[data-total]").inner_text()) == pytest.approx(true_s, abs=0.15)
        expect(test.locator("[data-segments] tr")).to_have_count(5)
        expect(test).to_contain_text("Healthy people of 60 to 69 years: mean 8.1 s")

        # a person corrects the start by half a second
        test.get_by_text("Correct start and end").click()
        start = float(test.get_by_label("Start, seconds").input_value())
        test.get_by_label("Start, seconds").fill(f"{start - 0.5:.2f}")
        test.get_by_role("button", name="Measure again").click()
        expect(test.locator("[data-total-note]")).to_contain_text("set manually")
        assert float(test.locator("[data-total]").inner_text()) == pytest.approx(true_s + 0.5, abs=0.15)

        # kept: the recording is measured with what is shown
        test.get_by_role("button", name="Keep and finish").click()
        page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), timeout=90_000)
        card = page.locator("section", has=page.locator("#h-test"))
        expect(card).to_contain_text("confirmed or set manually")
        total = float(card.locator(".kpi .v").first.evaluate("e => e.firstChild.textContent"))
        assert total == pytest.approx(true_s + 0.5, abs=0.15)

        # on the session page the same correction is made again, by its form
        card.get_by_text("Correct start and end").click()
        card.get_by_label("Test start, seconds").fill(f"{start - 1.0:.2f}")
        card.get_by_role("button", name="Measure again").click()
        expect(card.locator(".kpi .v").first).to_contain_text(f"{total + 0.5:.1f}", timeout=90_000)
        with running.client() as client:
            events = client.get(f"/api/v1/sessions/{session}/live/events").json()
        values = [e["content"]["value"] for e in events if e["kind"] == "test"]
        assert values[-1]["start_s"] == pytest.approx(start - 0.5, abs=0.01)
