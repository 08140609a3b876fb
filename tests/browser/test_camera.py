"""Camera in Chromium: permission, recording across a lost connection, playback with the trial."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.capturing import Clinic, choose, clinic, network, pair, place, start, tablet, walk_files
from tests.browser.conftest import FLAT, Launcher, Opener, RunningServer
from tests.browser.design import layout_faults, text_faults
from tests.browser.network import Network
from tests.browser.test_upload import SEGMENTS

pytestmark = pytest.mark.usefixtures("unknown_sensors")

__all__ = ["clinic", "network"]

FAKE = ["--use-fake-device-for-media-stream"]
CAMERA = "document.querySelector('capture-page').camera"


@pytest.fixture(scope="module")
def filming(launch: Launcher) -> Iterator[Browser]:
    """Chromium with a camera that is not real, and a person who allows it."""
    with launch([*FLAT, *FAKE, "--use-fake-ui-for-media-stream"]) as browser:
        yield browser


def agree(page: Page) -> None:
    page.get_by_label(re.compile("the person has agreed to be filmed")).check()


def test_a_take_is_filmed_though_the_line_breaks_and_plays_beside_the_figure(
    filming: Browser, running: RunningServer, clinic: Clinic, network: Network, opened: Opener
) -> None:
    with tablet(filming, network) as page:
        pair(page, clinic.code)
        card = page.locator("[data-camera]")
        expect(card.get_by_text("Without sound, up to 500")).to_be_visible()
        expect(card.locator("video")).to_be_hidden()  # nobody is seen before somebody agreed
        agree(page)
        expect(card.locator("video")).to_be_visible()
        page.wait_for_function("() => document.querySelector('[data-preview]').videoWidth > 0")
        card.get_by_role("button", name="Other camera").click()
        page.wait_for_function(f"() => {CAMERA}.stream?.active")
        card.get_by_role("button", name="Hide camera picture").click()
        expect(card.locator("video")).to_be_hidden()
        card.get_by_role("button", name="Show camera picture").click()
        choose(page, walk_files())
        place(page, SEGMENTS)
        assert not layout_faults(page) | text_faults(page)
        start(page)
        expect(page.locator("[data-films]")).to_have_text(re.compile(r"Filming \d+:\d\d"))
        assert (
            page.evaluate("document.querySelector('capture-page').camera.stream.getAudioTracks().length") == 0
        )
        page.wait_for_timeout(2500)
        network.cut()
        page.wait_for_timeout(3000)
        held = page.evaluate(f"{CAMERA}.outbox.held")
        assert held > 0
        network.mend()
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=60_000)
        expect(card).to_be_hidden(timeout=30_000)  # all of the film is there
        assert page.evaluate(f"{CAMERA}.stream") is None
    video = kept_video(clinic)
    assert video["media_type"] == "video/webm"
    assert video["consent_by"] == "anna"
    assert abs(video["offset_s"]) < 1.5  # the camera starts as the samples do
    page = opened("/audit")
    page.wait_for_load_state()
    expect(page.get_by_text("started filming a trial").first).to_be_visible()
    wait_for_analysis(clinic)
    page = opened(f"/sessions/{clinic.session}")
    page.wait_for_function("() => Number(document.querySelector('take-video')?.dataset.length) > 20")
    player = page.locator("take-video")
    expect(player.get_by_role("button", name=re.compile("Same moment"))).to_be_hidden()  # aligned already
    bar = page.locator("time-bar input")
    for t in (12.0, 4.0):
        bar.evaluate("(e, v) => { e.value = v; e.dispatchEvent(new Event('input')); }", t)
        page.wait_for_function(
            "(t) => { const v = document.querySelector('take-video video');"
            "return Math.abs(v.currentTime - t) < 0.05 && !v.seeking && v.readyState >= 2; }",
            arg=t + video["offset_s"],
        )
    expect(player.get_by_role("button", name="Realign")).to_be_visible()


def kept_video(clinic: Clinic) -> dict[str, Any]:
    answer = clinic.client.get(f"/api/v1/sessions/{clinic.session}/video")
    return dict(answer.raise_for_status().json())


def wait_for_analysis(clinic: Clinic) -> None:
    for _ in range(480):
        if clinic.client.get(f"/api/v1/sessions/{clinic.session}/analyses").raise_for_status().json():
            return
        time.sleep(0.5)
    pytest.fail("the take was not analysed")


def test_a_page_loaded_again_keeps_what_was_filmed_and_says_nothing_of_it_is_lost(
    filming: Browser, running: RunningServer, clinic: Clinic, network: Network
) -> None:
    with tablet(filming, network) as page:
        pair(page, clinic.code)
        agree(page)
        choose(page, walk_files())
        place(page, SEGMENTS)
        start(page)
        page.wait_for_timeout(2500)
        network.cut()
        page.wait_for_timeout(2500)
        held = page.evaluate(f"{CAMERA}.outbox.held")
        assert held > 0
        network.mend()
        page.reload()
        expect(page.locator("[data-go]")).to_have_text("Stop")
        page.wait_for_function(f"() => {CAMERA}.outbox?.held === 0")
        page.wait_for_timeout(1000)
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=60_000)
        expect(page.locator("[data-camera]")).to_be_hidden(timeout=30_000)
    assert kept_video(clinic)["size"] > held


def test_a_refused_camera_is_said_and_disturbs_nothing(
    launch: Launcher, running: RunningServer, clinic: Clinic
) -> None:
    browser = launch([*FLAT, *FAKE, "--deny-permission-prompts"])
    with tablet(browser, running) as page:
        pair(page, clinic.code)
        page.get_by_label(re.compile("the person has agreed to be filmed")).click()
        card = page.locator("[data-camera]")
        expect(card.get_by_text("Camera access was denied")).to_be_visible()
        expect(card.get_by_role("checkbox")).not_to_be_checked()
        choose(page, walk_files())
        place(page, SEGMENTS)
        start(page)
        expect(card).to_be_visible()
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=60_000)
    browser.close()
    assert clinic.client.get(f"/api/v1/sessions/{clinic.session}/video").status_code == 404


def test_only_the_capture_page_may_use_a_camera(running: RunningServer) -> None:
    allowed = httpx.get(f"{running.url}/capture").headers["Permissions-Policy"]
    other_headers = httpx.get(f"{running.url}/sign-in").headers["Permissions-Policy"]
    assert "camera=(self)" in allowed
    assert "camera=()" in other_headers
    assert "microphone=()" in allowed
