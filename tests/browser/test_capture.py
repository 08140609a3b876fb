"""The tablet's page in real Chromium against the real server: pair, stream, lose the network, reload, end."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.formats.live_log import decode_batch, parse_finish, read_batch_header, scan
from sagittal.core.formats.live_log import view_samples as payload_of
from sagittal.server.auth import accounts
from sagittal.server.auth.passwords import hash_password
from sagittal.server.auth.roles import Role
from sagittal.server.storage.db import Database
from sagittal.server.storage.migrate import upgrade
from tests.browser import filling
from tests.browser.capturing import (
    Clinic,
    choose,
    clinic,
    network,
    pair,
    place,
    start,
    stored_log,
    tablet,
    until,
    walk_files,
)
from tests.browser.conftest import NAME, PASSWORD, RunningServer, serve
from tests.browser.design import layout_faults, text_faults
from tests.browser.network import Network
from tests.browser.test_upload import SEGMENTS

pytestmark = pytest.mark.usefixtures("unknown_sensors")

__all__ = ["clinic", "network"]

SIZES = ((810, 1080), (1280, 800), (1024, 768), (360, 740))
RECORDED_S = 25.03


def expected_samples() -> dict[str, np.ndarray[Any, np.dtype[np.float32]]]:
    files = [SourceFile(n, len(c), lambda c=c: c) for n, c in walk_files()]  # type: ignore[misc]
    streams = read_recording(files, None).streams
    return {
        device: np.hstack([streams[device].acc, streams[device].gyr, streams[device].mag]).astype(np.float32)  # type: ignore[list-item]
        for device in SEGMENTS
    }


def test_a_walk_played_on_the_tablet_is_the_recording_though_network_and_page_went_away(
    flat: Browser, running: RunningServer, clinic: Clinic, network: Network
) -> None:
    with tablet(flat, network) as page:
        pair(page, clinic.code)
        choose(page, walk_files())
        expect(page.locator("[data-sum]")).to_contain_text("2 copies excluded")
        place(page, SEGMENTS)
        expect(page.locator("[data-go]")).to_have_text("Start with 7 sensors")
        began = time.monotonic()
        start(page)
        expect(page.locator("[data-say]")).to_have_text("Stand still")
        # what to do follows the server's calibration
        expect(page.locator("[data-say]")).to_have_text("Walk straight ahead", timeout=15_000)
        assert clinic.take()["state"] == "streaming"

        network.cut()
        page.wait_for_timeout(1500)
        expect(page.locator("[data-link]")).to_contain_text(re.compile("Storing \\d\\.\\d s here"))
        page.wait_for_timeout(3500)
        # recording goes on without the network
        until(page, "page.outbox.made - page.outbox.acked > 80", 5)
        network.mend()
        until(page, "page.outbox.made - page.outbox.acked < 10")

        network.cut()
        page.wait_for_timeout(1000)
        network.mend()
        page.reload()
        expect(page.locator("[data-go]")).to_have_text("Stop")
        expect(page.locator("[data-link]")).to_have_text("Connected", timeout=10_000)

        left_s = began + RECORDED_S + 15 - time.monotonic()
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=1000 * left_s)
        assert time.monotonic() - began > RECORDED_S, "at the speed it was recorded"
        assert page.evaluate("async () => (await indexedDB.databases()).length") == 1
    take = clinic.take()
    assert take["state"] == "finished"
    assert take["problem"] is None

    log = clinic.log(running)
    records, length = scan(log)
    assert length == len(log)
    frames = [r.body for r in records if r.kind == "B"]
    headers = [read_batch_header(f) for f in frames]
    assert [h.seq for h in headers] == list(range(len(frames)))
    end = parse_finish(records[-1].body)
    assert end.count == len(frames)
    digest = hashlib.sha256()
    for frame, header in zip(frames, headers, strict=True):
        digest.update(payload_of(frame, header))
    assert digest.hexdigest() == end.sha256

    samples = np.concatenate([decode_batch(f).samples for f in frames])
    expected = expected_samples()
    order = sorted(SEGMENTS)
    assert len(samples) == len(expected[order[0]])
    for i, device in enumerate(order):
        np.testing.assert_array_equal(samples[:, i], expected[device])
    starts = np.array([h.t0_us for h in headers])
    counts = np.cumsum([0, *(h.n_samples for h in headers)])[:-1]
    np.testing.assert_array_equal(starts, counts * 10_000)


def test_the_tablet_says_whether_the_calibration_passes_and_takes_it_back_at_a_redo(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    with tablet(flat, running) as page:
        pair(page, clinic.code)
        choose(page, walk_files())
        place(page, SEGMENTS)
        start(page)
        verdict = page.locator("[data-verdict]")
        expect(verdict).to_be_hidden()
        expect(verdict).to_contain_text("alibrat", timeout=90_000)
        assert not layout_faults(page) | text_faults(page)
        clinic.post("/live/commands", command="redo_calibration")
        expect(verdict).to_be_hidden(timeout=20_000)


def test_a_server_that_dies_in_the_middle_has_everything_in_the_end(flat: Browser, tmp_path: Path) -> None:
    upgrade(tmp_path / "sagittal.db")
    db = Database(tmp_path / "sagittal.db")
    with db.write() as c:
        accounts.create(c, NAME, "Anna", Role.ADMIN, hash_password(PASSWORD))
    db.close()
    columns = [f"L_foot.{kind}_{axis}" for kind in ("acc", "gyr") for axis in "xyz"]
    rows = [[n / 100, *(c + n / 1000 for c in range(6))] for n in range(1500)]
    lines = [",".join(["t_s", *columns]), *(",".join(map(str, row)) for row in rows)]
    table = "\n".join(lines)
    with contextlib.ExitStack() as servers:
        server = servers.enter_context(serve(tmp_path, records_only=True))
        client = servers.enter_context(server.client())
        patient = filling.add(client, "/patients", code="CAP-K9")["id"]
        session = filling.add_session(client, patient, "Walk")
        code = filling.add(client, f"/sessions/{session}/live")["code"]
        network = Network(server.url)
        servers.callback(network.close)
        with tablet(flat, network) as page:
            pair(page, code)
            choose(page, [("walk.csv", table.encode())])
            start(page)
            until(page, "page.outbox.acked > 40")
            os.kill(server.pid, signal.SIGKILL)
            expect(page.locator("[data-link]")).to_contain_text("Storing", timeout=10_000)
            server = servers.enter_context(serve(tmp_path, records_only=True))
            network.lead_to(server.url)
            expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=60_000)
        with server.client() as second_client:
            records, _ = scan(stored_log(second_client, server, session))
    samples = np.concatenate([decode_batch(r.body).samples[:, 0, :6] for r in records if r.kind == "B"])
    np.testing.assert_array_equal(samples, np.array(rows)[:, 1:].astype(np.float32))


def test_a_network_that_only_goes_silent_is_noticed_and_nothing_is_lost(
    flat: Browser, running: RunningServer, clinic: Clinic, network: Network
) -> None:
    with tablet(flat, network) as page:
        pair(page, clinic.code)
        choose(page, walk_files())
        place(page, {"00B40C55": "foot_l", "00B40C48": "foot_r"})
        start(page)
        until(page, "page.outbox.acked > 20")
        network.freeze()
        expect(page.locator("[data-link]")).to_contain_text("Storing", timeout=8_000)
        network.mend()
        expect(page.locator("[data-link]")).to_have_text("Connected", timeout=12_000)
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=20_000)
    records, _ = scan(clinic.log(running))
    samples = np.concatenate([decode_batch(r.body).samples for r in records if r.kind == "B"])
    expected = expected_samples()
    np.testing.assert_array_equal(samples[:, 0], expected["00B40C48"][: len(samples)])
    np.testing.assert_array_equal(samples[:, 1], expected["00B40C55"][: len(samples)])
    assert len(samples) > 500


def test_a_wrong_code_is_refused_in_words_and_the_next_one_is_taken(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    with tablet(flat, running) as page:
        for key in "222222":
            page.get_by_role("button", name=key, exact=True).click()
        expect(page.get_by_role("alert")).to_be_visible()
        expect(page.locator("[data-go]")).to_be_disabled()
        pair(page, clinic.code)
        expect(page.get_by_role("alert")).to_be_hidden()
        expect(page.locator("[data-session-title]")).to_have_text("Walk, 10 m overground")
        assert page.locator("[data-code]").inner_text().split() == [clinic.code[:3], clinic.code[3:]]


def test_the_therapist_ends_the_take_and_the_tablet_says_so(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    with tablet(flat, running) as page:
        # the therapist's page on the same device leads here with its code: nobody types or sees it
        page.goto("about:blank")
        page.goto(f"/capture#{clinic.code}")
        expect(page.locator("[data-paired]")).to_contain_text("Paired with CAP-")
        assert page.url.endswith("/capture")
        choose(page, walk_files())
        place(page, {"00B40C55": "foot_l"})
        start(page)
        until(page, "page.outbox.acked > 5")
        clinic.post("/live/commands", command="stop")
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=20_000)
        page.locator("[data-go]").click()
        expect(page.get_by_label("Pairing code")).to_be_focused()
    assert clinic.take()["state"] == "finished"


def test_what_is_left_when_the_take_was_closed_can_be_saved(
    flat: Browser, running: RunningServer, clinic: Clinic, network: Network
) -> None:
    with tablet(flat, network) as page:
        pair(page, clinic.code)
        choose(page, walk_files())
        place(page, {"00B40C55": "foot_l"})
        start(page)
        until(page, "page.outbox.acked > 20")
        network.cut()
        page.wait_for_timeout(2500)
        clinic.post("/live/close")
        network.mend()
        expect(page.get_by_role("alert")).to_contain_text("ended on the clinic's screen", timeout=15_000)
        page.reload()
        expect(page.locator("[data-go]")).to_have_text("Save or delete the remaining data", timeout=10_000)
        expect(page.get_by_role("button", name="Save remaining data")).to_be_visible()
        acknowledged = page.evaluate("() => document.querySelector('capture-page').outbox.acked")
        with page.expect_download() as saving:
            page.get_by_role("button", name="Save remaining data").click()
        content = saving.value.path().read_bytes()
        page.get_by_role("button", name="Delete it").first.click()
        page.locator("dialog[open]").get_by_role("button", name="Delete it").click()
        expect(page.get_by_label("Pairing code")).to_be_visible()
    recording = read_recording([SourceFile("rest.sagittal-live", len(content), lambda: content)], None)
    acc = expected_samples()["00B40C55"][:, :3]
    left = recording.streams["00B40C55"].acc.astype(np.float32)
    np.testing.assert_array_equal(left, acc[5 * acknowledged : 5 * acknowledged + len(left)])
    # nothing is missing between what the server has and what was saved
    there = sum(read_batch_header(r.body).n_samples for r in scan(clinic.log(running))[0] if r.kind == "B")
    assert 5 * acknowledged <= there < 5 * acknowledged + len(left)
    assert len(left) > 150


def test_a_tablet_keeps_its_pairing_and_its_mapping_over_a_reload(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    with tablet(flat, running) as page:
        pair(page, clinic.code)
        choose(page, walk_files())
        place(page, SEGMENTS)
        start(page)
        until(page, "page.outbox.acked > 5")
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_be_visible(timeout=20_000)
        second_response = clinic.post("/live")["code"]
        page.locator("[data-go]").click()
        pair(page, second_response)
        page.reload()
        expect(page.locator("[data-paired]")).to_contain_text("Paired with CAP-")
        choose(page, walk_files())
        expect(page.locator("[data-go]")).to_have_text("Start with 7 sensors")


def test_a_second_tab_stays_away(flat: Browser, running: RunningServer) -> None:
    with tablet(flat, running) as page:
        expect(page.get_by_label("Pairing code")).to_be_visible()
        other_other_page = page.context.new_page()
        other_other_page.goto("/capture")
        expect(other_other_page.get_by_role("alert")).to_contain_text("another tab")


def test_every_state_of_the_page_obeys_the_design_system(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    faults: list[str] = []

    def check(page: Page, name: str) -> None:
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
                page.wait_for_timeout(30)
                result = layout_faults(page) | text_faults(page)
                faults.extend([f"{name} {width} {scheme}: {result}"] if result else [])
                small = page.evaluate(
                    "() => [...document.querySelectorAll('button, input')]"
                    ".filter((e) => e.offsetHeight && (e.closest('label.check') ?? e).offsetHeight < 56)"
                    ".map((e) => e.outerHTML)"
                )
                assert not small, f"{name}: under 56 px: {small}"
        page.set_viewport_size({"width": 810, "height": 1080})

    with tablet(flat, running) as page:
        expect(page.get_by_label("Pairing code")).to_be_visible()
        check(page, "pairing")
        pair(page, clinic.code)
        check(page, "sources")
        choose(page, walk_files())
        expect(page.locator("li[data-sensor]")).to_have_count(9)
        check(page, "sensors")
        place(page, SEGMENTS)
        page.locator("li[data-sensor='00B40C44'] [data-place]").click()
        check(page, "places")
        page.keyboard.press("Escape")
        start(page)
        check(page, "running")
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_be_visible(timeout=20_000)
        check(page, "done")
    assert not faults, "\n".join(faults)


def test_the_whole_page_works_by_keyboard(flat: Browser, running: RunningServer, clinic: Clinic) -> None:
    with tablet(flat, running) as page:
        expect(page.get_by_label("Pairing code")).to_be_focused()
        page.keyboard.type(clinic.code)
        expect(page.locator("[data-paired]")).to_be_visible()
        choose(page, walk_files())
        page.locator("li[data-sensor='00B40B91'] [data-place]").focus()
        page.keyboard.press("Enter")
        page.locator("dialog[open] button[value=pelvis]").focus()
        page.keyboard.press("Enter")
        expect(page.locator("li[data-sensor='00B40B91'] [data-segment]")).to_have_text("Pelvis")
        page.locator("[data-go]").focus()
        page.keyboard.press("Space")
        expect(page.locator("[data-go]")).to_have_text("Stop")
        page.keyboard.press("Space")
        page.wait_for_timeout(1000)
        expect(page.locator("[data-go]")).to_have_text("Stop")  # a second tap at once is a slip
        page.keyboard.press("Space")
        expect(page.locator("[data-done]")).to_be_visible(timeout=20_000)
