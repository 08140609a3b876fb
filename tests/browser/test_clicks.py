"""How many clicks it takes: upload to overview, number to strides, a stride left out, a live recording."""

from __future__ import annotations

import re
from pathlib import Path
from uuid import uuid4

import pytest
from playwright.sync_api import Page, expect

from tests.browser import filling
from tests.browser.capturing import choose, place, walk_files
from tests.browser.clicking import Hand
from tests.browser.conftest import Filled, Opener, RunningServer
from tests.browser.design import axe_faults
from tests.browser.test_timeline import pick_counted
from tests.browser.test_upload import SEGMENTS
from tests.data import data_folder

OF_ALL = ("/cadence_spm",)
"""A number of the whole walk: its page has the mean, and no row of each stride."""


@pytest.mark.usefixtures("unknown_sensors")
def test_an_upload_is_five_clicks_from_its_overview(opened: Opener, running: RunningServer) -> None:
    files = sorted(data_folder("neura_walk", "rawimu").glob("*.txt"))
    with running.client() as client:
        patient = filling.add(client, "/patients", code=f"CLICK-{uuid4().hex[:6]}", height_m=1.75)["id"]
        session = filling.add_session(client, patient, "Walk, 10 m overground")
    page, hand = opened(f"/sessions/{session}/upload", stays=True), Hand()
    hand.pick_files(page.get_by_role("button", name="Choose files"), files)
    left_foot = page.locator("[data-ask-id]")
    expect(left_foot).to_have_text(re.compile(r"\S"), timeout=60_000)
    answer = "keep" if SEGMENTS[left_foot.inner_text()] == "foot_l" else "swap"
    hand.click(page.locator(f"[data-sides={answer}]"))
    hand.click(page.locator("[data-analyse]"))
    page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), wait_until="commit")
    expect(page.locator("h2", has_text="Key values")).to_be_visible(timeout=180_000)
    assert hand.clicks <= 5


def test_a_number_is_one_click_from_its_strides(opened: Opener, filled: Filled) -> None:
    overview = f"/sessions/{filled.done}"
    page = opened(overview, stays=True)
    rows = page.locator("#rows a[href*='/parameters/']")
    assert rows.count() >= 5
    for k in range(rows.count()):
        hand = Hand()
        hand.click(rows.nth(k))
        _shows_strides(page)
        assert hand.clicks == 1
        page.goto(overview)
    page.get_by_label("Find a value").fill("stride time")
    hand = Hand()
    hand.click(page.locator("all-values").get_by_role("link", name="Stride time", exact=True).first)
    _shows_strides(page)
    assert hand.clicks == 1


def _shows_strides(page: Page) -> None:
    page.wait_for_url(re.compile(r"/parameters/\w+$"))
    if not page.url.endswith(OF_ALL):
        expect(page.locator("main table tbody tr").first).to_be_visible()


def test_a_stride_is_left_out_by_two_clicks(opened: Opener, running: RunningServer, filled: Filled) -> None:
    page, hand = opened(f"/sessions/{filled.done}/timeline", stays=True), Hand()
    page.locator(".ev").first.wait_for()
    try:
        pick_counted(page)
        hand.clicks += 1  # that is at a place between two handles
        hand.click(page.get_by_role("button", name="Turn or obstacle"))
        expect(page.locator("[data-verdict]")).to_have_text("excluded")
        assert hand.clicks <= 2
    finally:
        with running.client() as client:
            while client.delete(f"/api/v1/sessions/{filled.done}/edits").is_success:
                pass


@pytest.mark.usefixtures("unknown_sensors")
def test_a_live_recording_with_known_sensors_starts_by_ten_clicks(
    opened: Opener, running: RunningServer
) -> None:
    with running.client() as client:
        code = f"CAP-{uuid4().hex[:6]}"
        patient = filling.add(client, "/patients", code=code, height_m=1.75)["id"]
    page = opened(f"/patients/{patient}")
    for is_known in (False, True):
        hand = Hand()
        page.goto(f"/patients/{patient}")
        hand.click(page.get_by_role("link", name="New visit").first)
        page.wait_for_url(re.compile(r"/sessions/new$"))  # loaded: its script is there
        hand.click(page.get_by_role("button", name="Record live"))
        page.wait_for_url(re.compile(r"/live$"))
        hand.click(page.get_by_role("button", name="Open for the tablet"))
        with page.expect_popup() as opening:
            hand.click(page.get_by_role("link", name="Use this device"))
        device = opening.value
        expect(device.locator("[data-paired]")).to_contain_text(code)
        if not is_known:
            choose(device, walk_files())
            place(device, SEGMENTS)
        else:
            hand.pick_files(device.get_by_role("button", name="Recorded files"), _walk_paths())
        go = device.locator("[data-go]")
        expect(go).to_have_text("Start with 7 sensors")
        hand.click(go)
        expect(device.locator("[data-link]")).to_have_text("Connected", timeout=10_000)
        if is_known:
            assert hand.clicks <= 10
        device.wait_for_timeout(1500)
        device.locator("[data-go]").click()
        expect(device.locator("[data-done]")).to_have_text("Recording is on the server", timeout=60_000)
        page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), wait_until="commit")  # it goes on by itself
        device.close()


def _walk_paths() -> list[Path]:
    return sorted(data_folder("neura_walk", "rawimu").glob("*.txt"))


TABLES = [
    ("ipol_walks", "12-3_l[bf].txt", None),
    ("gaitmap_foot", "imu_sample.csv", "204.8"),
]


@pytest.mark.parametrize(("folder", "pattern", "rate"), TABLES, ids=[t[0] for t in TABLES])
def test_an_unknown_table_is_eight_clicks_from_its_analysis(
    opened: Opener, running: RunningServer, folder: str, pattern: str, rate: str | None
) -> None:
    files = sorted(data_folder(folder).glob(pattern))
    if folder == "ipol_walks":
        files += sorted(data_folder(folder).glob("12-3_rf.txt"))
    with running.client() as client:
        patient = filling.add(client, "/patients", code=f"CLICK-{uuid4().hex[:6]}", height_m=1.75)["id"]
        session = filling.add_session(client, patient, "Walk, 10 m overground")
    page, hand = opened(f"/sessions/{session}/upload", stays=True), Hand()
    hand.pick_files(page.get_by_role("button", name="Choose files"), files)
    columns = page.locator("column-map")
    expect(columns).to_be_visible(timeout=60_000)
    if rate is not None:
        hand.click(columns.locator("[data-rate]"))
        page.keyboard.type(rate)
    expect(columns.locator("[data-check=ok]").first).to_contain_text("Hz", timeout=20_000)
    assert columns.locator("[data-check]:not([data-check=ok])").count() == 0
    assert axe_faults(page) == []
    hand.click(columns.get_by_role("button", name="Use these columns"))
    expect(page.locator("sensor-map")).to_be_visible(timeout=180_000)
    expect(page.locator("[data-sum]")).not_to_be_empty()
    answer = page.locator("[data-sides=keep]")
    if answer.is_visible():
        hand.click(answer)
    hand.click(page.locator("[data-analyse]"))
    page.wait_for_url(re.compile(r"/sessions/[0-9a-f]{32}$"), wait_until="commit")
    assert hand.clicks <= 8
    with running.client() as client:
        manifest = client.get(f"/api/v1/sessions/{session}/recording").json()["manifest"]
    assert {s["file"] for s in manifest["sources"]} == {f.name for f in files}
