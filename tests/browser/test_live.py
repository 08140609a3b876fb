"""A live session from pairing to the session page: a real walk at its own speed, tablet, server, screens."""

from __future__ import annotations

import re
from collections import defaultdict
from urllib.parse import urlsplit
from uuid import uuid4

import pytest
from playwright.sync_api import Browser, expect

from sagittal.core.online import compile_live_kernels
from tests.browser import filling
from tests.browser.capturing import choose, network, place, start, tablet, walk_files
from tests.browser.conftest import Opener, RunningServer
from tests.browser.network import Network
from tests.browser.picture import wait_for_picture
from tests.browser.streaming import until_strides, walking
from tests.browser.test_live_screens import prescribe
from tests.browser.test_upload import SEGMENTS

__all__ = ["network"]

RHYTHM = {
    "parameter": "stride_time_s",
    "side": None,
    "target": {"source": "manual", "mean": 1.46, "sd": 0.02},
    "modes": ["bar", "tone", "tick"],
    "schedule": {"kind": "every", "probe_every": None, "retention_strides": 0},
    "progression": {"start_level": 0, "worse": "high"},
}
"""Amid the stride times of this walk, 1.34 to 1.51 s: its strides lie in the zone and on both sides of it."""

HEAD, WALK, STAND = 6, 1120, 2075
"""Lines before the samples of neura_walk, and where in them the walk begins and ends."""


def longer(files: list[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
    """The same with the walk three times over: after calibration the real one has three strides left."""
    result = []
    for name, content in files:
        lines = content.decode().splitlines(keepends=True)
        rows = [line.split(",", 1) for line in lines[HEAD:]]
        first = int(rows[0][0])
        order = [*rows[:STAND], *rows[WALK:STAND], *rows[WALK:STAND], *rows[STAND:]]
        notices = (f"{first + i},{remainder}" for i, (_, remainder) in enumerate(order))
        result.append((name, "".join([*lines[:HEAD], *notices]).encode()))
    return result


WATCH = """() => {
  const text = (selector) => {
    const element = document.querySelector(selector);
    return element?.checkVisibility() ? element.innerText : '';
  };
  let last = {};
  setInterval(() => {
    const canvas = document.querySelector('stride-chart canvas');
    const now = {
      chart: canvas?.checkVisibility() && canvas.width ? canvas.toDataURL().slice(-400) : '',
      message: text('[data-message]'),
      pause: text('[data-pause-title]'),
      zone: text('[data-in-zone]'),
      mark: text('[data-last-mark]'),
      value: text('[data-left]'),
      over: text('[data-over-title]'),
    };
    for (const [key, value] of Object.entries(now)) if (value && last[key] !== value) note(key, value);
    last = now;
  }, 250);
}"""
"""Tells what a screen shows whenever it changes."""


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """Have the kernels on disk, so that the estimator is ready before the walk is over."""
    compile_live_kernels()


@pytest.mark.journey
def test_a_walk_goes_from_the_tablet_to_both_screens_and_becomes_a_session(
    opened: Opener, flat: Browser, running: RunningServer, network: Network
) -> None:
    with running.client() as client:
        code = f"CAP-{uuid4().hex[:6]}"
        patient = filling.add(client, "/patients", code=code, sex="female", birth_year=1990, height_m=1.7)
        prescribe(client, patient["id"], **RHYTHM)

    page = opened(f"/patients/{patient['id']}/sessions/new")
    page.get_by_role("button", name="Record live").click()
    page.wait_for_url(re.compile(r"/live$"))  # loaded: its button works
    page.get_by_role("button", name="Open for the tablet").click()
    expect(page.locator("[data-code]")).to_have_text(re.compile(r"^\w{3} \w{3}$"))
    with tablet(flat, network) as device:
        device.get_by_label("Pairing code").press_sequentially(page.locator("[data-code]").inner_text())
        expect(device.locator("[data-paired]")).to_contain_text(code)
        expect(page.locator("[data-waiting]")).to_contain_text("The tablet is paired")
        choose(device, longer(walk_files()))
        place(device, SEGMENTS)
        observations: dict[str, list[str]] = defaultdict(list)
        page.expose_function("note", lambda key, value: observations[key].append(value))
        page.evaluate(WATCH)
        screen = opened(f"{urlsplit(page.url).path}/patient")
        screen.expose_function("note", lambda key, value: observations[key].append(value))
        screen.evaluate(WATCH)
        screen.get_by_role("button", name="With sound").click()
        start(device)

        # calibration: stand, then walk
        expect(page.locator("live-page")).to_have_attribute("data-view", "calibrate", timeout=15_000)
        expect(page.locator("live-calibration [data-say]")).to_contain_text(
            "walk straight ahead", timeout=10_000
        )
        expect(page.locator("live-sensors [data-all]")).to_have_text("7 of 7 good")
        expect(screen.locator("[data-pause-title]")).to_have_text("Walk on")

        # five seconds without network: both screens say so
        network.cut()
        expect(page.locator("[data-note=tablet]")).to_contain_text("Nothing is lost", timeout=8_000)
        expect(screen.locator("[data-pause-title]")).to_have_text("Short pause")
        device.wait_for_timeout(4500)
        network.mend()
        expect(page.locator("[data-note=tablet]")).to_have_count(0, timeout=10_000)

        # the walk
        expect(page.locator("live-page")).to_have_attribute("data-view", "run", timeout=30_000)
        page.get_by_role("button", name="Mark", exact=True).click()
        page.get_by_label("What happened").fill("looked up")
        page.keyboard.press("Enter")
        expect(screen.locator("[data-pause-title]")).to_have_text("Well done", timeout=60_000)
        expect(device.locator("[data-done]")).to_have_text("Recording is on the server", timeout=30_000)
    assert len(set(observations["chart"])) > 3, "the chart stands still"
    assert len(set(observations["value"])) > 2
    assert len(set(observations["message"])) > 1, "feedback does not change with the stride"
    assert any("“looked up”" in text for text in observations["mark"])
    assert re.match(r"\d+ of \d+ in zone", observations["zone"][-1])

    # the end: saved, analysed, opened
    page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), timeout=60_000)
    assert set(observations["over"]) <= {
        "Recording saved"
    }  # it may be analysed before anybody could read that
    expect(page.get_by_role("heading", name="Key values")).to_be_visible(timeout=30_000)
    with running.client() as client:
        session = page.url.rsplit("/", 1)[1]
        take = client.get(f"/api/v1/sessions/{session}/live").json()
        events = client.get(f"/api/v1/sessions/{session}/live/events").json()
    assert (take["state"], take["problem"]) == ("finished", None)
    assert {"cue", "mark", "calibration"} <= {e["kind"] for e in events}
    visible_contents = [e["content"] for e in events if e["kind"] == "cue" and e["content"]["shown"]]
    assert len({c["zone"] for c in visible_contents}) > 1


def test_the_figure_walks_and_stop_ends_the_take(
    opened: Opener, solid: Browser, running: RunningServer
) -> None:
    with walking(running) as session:
        page = opened(f"/sessions/{session}/live", browser=solid)
        until_strides(page, 2)
        page.get_by_role("button", name="Norm").dispatch_event("click")
        initial = wait_for_picture(page, lambda now: min(now["orange"], now["blue"]) > 150)
        final = wait_for_picture(page, lambda now: now != initial and min(now["orange"], now["blue"]) > 150)
        assert final != initial, "the figure stands still"
        page.get_by_role("button", name="STOP").click()
        page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), timeout=90_000)
