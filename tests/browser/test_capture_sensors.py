"""The own sensors of a tablet in real Chromium: Bluetooth by a made radio (no DOT is here), made motions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from sagittal.core.formats.live_log import decode_batch, parse_hello, scan
from tests.browser.capturing import Clinic, clinic, pair, start, tablet, until
from tests.browser.conftest import RunningServer
from tests.browser.test_capture_codec import turned_device

__all__ = ["clinic"]

RADIO = (Path(__file__).parent / "dot_radio.js").read_text()
"""A Bluetooth of two DOTs that answer as the specification says; stands where the browser's own would be."""


def with_radio(page: Page) -> None:
    page.add_init_script(RADIO)
    page.reload()


def add_sensor(page: Page) -> None:
    source = page.get_by_role("button", name="Movella DOT sensors")
    (source if source.is_visible() else page.get_by_role("button", name="Add sensor")).click()


def read_log(clinic: Clinic, running: RunningServer) -> tuple[Any, dict[int, list[Any]]]:
    records, _ = scan(clinic.log(running))
    hello = parse_hello(records[0].body)
    streams: dict[int, list[Any]] = {s.stream: [] for s in hello.streams}
    for record in records:
        if record.kind == "B":
            batch = decode_batch(record.body)
            streams[batch.stream].append(batch)
    return hello, streams


def test_dots_stream_with_their_own_clocks_and_go_on_after_losing_the_radio(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    with tablet(flat, running) as page:
        with_radio(page)
        pair(page, clinic.code)
        add_sensor(page)
        expect(page.locator("li[data-sensor]")).to_have_count(1)
        add_sensor(page)
        expect(page.locator("li[data-sensor]")).to_have_count(2)
        rows = page.locator("li[data-sensor]")
        # names that people gave them say where they are worn
        expect(rows.nth(0).locator("[data-segment]")).to_have_text("Shank")
        expect(rows.nth(0).locator("[data-side]")).to_have_text("L")
        expect(rows.nth(0).locator("[data-batn]")).to_have_text("81 %")
        expect(rows.nth(0).locator("[data-state]")).to_have_text("Ready", timeout=8000)
        expect(rows.nth(0).locator("[data-rate]")).to_have_text("60 Hz", timeout=8000)
        expect(page.locator("[data-go]")).to_have_text("Start with 2 sensors")
        assert page.evaluate("() => radio.orders") == [[1, 1, 21], [1, 1, 21]]
        start(page)
        until(page, "page.outbox.acked > 10")
        page.evaluate("() => radio.lose(0)")
        expect(page.get_by_role("alert")).to_contain_text("is not sending", timeout=8000)
        page.evaluate("() => radio.find(0)")
        expect(page.get_by_role("alert")).to_be_hidden(timeout=12_000)
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_be_visible(timeout=20_000)
    hello, streams = read_log(clinic, running)
    assert hello.source == "dot"
    assert [(s.clock, s.rate_hz) for s in hello.streams] == [("own", 60.0)] * 2
    assert [s.sensors[0].id for s in hello.streams] == ["D422CD000101", "D422CD000102"]
    for number, batches in streams.items():
        t = np.concatenate([b.t0_us + b.offsets_us.astype(np.int64) for b in batches])
        samples = np.concatenate([b.samples[:, 0] for b in batches])
        assert (np.diff(t) > 0).all()
        # the sensor's own ticks of 16 667 µs survive the radio's jitter
        assert np.median(np.abs(np.diff(t) - 16_667)) <= 1
        np.testing.assert_allclose(samples[:, :3], [[0.1, -0.2, 9.8]] * len(t), rtol=1e-6)
        np.testing.assert_allclose(samples[:, 3:6], np.radians([[1, 2, -3]] * len(t)), rtol=1e-6)
        assert np.isnan(samples[:, 6:]).all()
        gap = np.max(np.diff(t)) / 1e6
        assert (gap > 2) == (number == 0), "the hole keeps its time"


def test_dots_go_on_after_a_reload_when_they_are_connected_again(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    with tablet(flat, running) as page:
        with_radio(page)
        pair(page, clinic.code)
        add_sensor(page)
        add_sensor(page)
        expect(page.locator("[data-go]")).to_have_text("Start with 2 sensors", timeout=8000)
        start(page)
        until(page, "page.outbox.acked > 10")
        page.reload()
        expect(page.locator("[data-go]")).to_have_text("Connect the sensors again")
        initial_evaluation = page.evaluate("() => document.querySelector('capture-page').outbox.made")
        page.evaluate("() => radio.turn()")  # the other one is nearer now
        page.wait_for_timeout(800)
        page.locator("[data-go]").click()
        expect(page.locator("li[data-sensor]")).to_have_count(1)
        page.locator("[data-go]").click()
        expect(page.locator("[data-go]")).to_have_text("Stop")
        until(page, f"page.outbox.acked > {initial_evaluation} + 10")
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_be_visible(timeout=20_000)
    _, streams = read_log(clinic, running)
    for batches in streams.values():
        t = np.concatenate([b.t0_us + b.offsets_us.astype(np.int64) for b in batches])
        assert (np.diff(t) > 0).all()
        assert np.max(np.diff(t)) > 300_000


def test_an_interrupted_take_can_be_ended_without_its_sensors(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    with tablet(flat, running) as page:
        with_radio(page)
        pair(page, clinic.code)
        add_sensor(page)
        expect(page.locator("[data-go]")).to_have_text("Start with 1 sensor", timeout=8000)
        start(page)
        until(page, "page.outbox.acked > 5")
        page.reload()
        page.get_by_role("button", name="Stop here").click()
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=20_000)
    assert clinic.take()["state"] == "finished"


def test_a_browser_without_bluetooth_says_so(flat: Browser, running: RunningServer, clinic: Clinic) -> None:
    with tablet(flat, running) as page:
        page.add_init_script("Object.defineProperty(navigator, 'bluetooth', { value: undefined });")
        page.reload()
        pair(page, clinic.code)
        source = page.get_by_role("button", name="Movella DOT sensors")
        expect(source).to_be_disabled()
        expect(source).to_contain_text("Use Chrome or Edge")


MOVE = """(rows) => new Promise((done) => {
    const began = performance.now();
    const step = () => {
      const t = (performance.now() - began) / 1000;
      while (rows.length && rows[0][0] <= t) {
        const [, x, y, z, alpha, beta, gamma] = rows.shift();
        dispatchEvent(new DeviceMotionEvent('devicemotion', {
          accelerationIncludingGravity: { x, y, z }, rotationRate: { alpha, beta, gamma }, interval: 16 }));
      }
      if (rows.length) setTimeout(step, 5); else done();
    };
    step();
  })"""


def test_a_device_without_motion_is_not_asked_to_be_turned(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    with tablet(flat, running) as page:
        pair(page, clinic.code)
        page.get_by_role("button", name="This device itself").click()
        expect(page.locator("[data-axes-say]")).to_have_text("This device sends no motion data")
        expect(page.locator("[data-go]")).to_be_disabled()


def test_the_device_itself_is_a_sensor_after_its_self_test(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    turning = turned_device("zxy", -1)  # signs of one family of browsers, order of another
    lying = [[n / 60, 0.0, 0.0, -9.81, 30.0, 10.0, 20.0] for n in range(240)]
    with tablet(flat, running) as page:
        pair(page, clinic.code)
        page.get_by_role("button", name="This device itself").click()
        expect(page.locator("[data-axes-say]")).to_have_text("1 of 4: Lay the device flat, screen up")
        expect(page.locator("[data-go]")).to_be_disabled()
        page.evaluate(MOVE, turning)
        expect(page.locator("[data-axes-say]")).to_have_text("Axes of this device checked")
        page.locator("li[data-sensor] [data-place]").click()
        page.locator("dialog[open] button[value=pelvis]").click()
        page.evaluate("(rows) => { (%s)(rows); }" % MOVE, lying)  # noqa: UP031
        expect(page.locator("[data-go]")).to_have_text("Start with 1 sensor")
        start(page)
        until(page, "page.outbox.acked > 10")
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_be_visible(timeout=20_000)
    hello, streams = read_log(clinic, running)
    assert hello.source == "device_motion"
    assert 50 < hello.streams[0].rate_hz < 70
    samples = np.concatenate([b.samples[:, 0] for b in streams[0]])
    # as the device is: x right, y up the screen, z out of it, whatever the browser calls them
    np.testing.assert_allclose(samples[:, :3], [[0, 0, 9.81]] * len(samples), atol=1e-5)
    np.testing.assert_allclose(samples[:, 3:6], np.radians([[10, 20, 30]] * len(samples)), rtol=1e-5)
    assert all(b.offsets_us is not None for b in streams[0])


def test_a_failed_self_test_is_said_and_can_be_repeated(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    broken = [[*row[:4], 0.0, 0.0, 0.0] for row in turned_device("xyz", 1)]
    with tablet(flat, running) as page:
        pair(page, clinic.code)
        page.get_by_role("button", name="This device itself").click()
        page.evaluate(MOVE, broken)
        expect(page.locator("[data-axes-more]")).to_contain_text("do not match gravity")
        page.get_by_role("button", name="Check again").click()
        expect(page.locator("[data-axes-say]")).to_contain_text("1 of 4")


def test_a_new_code_goes_on_with_the_take_of_a_tablet_that_was_sent_away(
    flat: Browser, running: RunningServer, clinic: Clinic
) -> None:
    rows = "t_s," + ",".join(f"L_foot.{k}_{a}" for k in ("acc", "gyr") for a in "xyz")
    table = "\n".join([rows, *(f"{n / 100:.2f},0,0,9.81,0,0,{n / 1000:.3f}" for n in range(3000))])
    with tablet(flat, running) as page:
        pair(page, clinic.code)
        page.locator("[data-files]").set_input_files(
            {"name": "walk.csv", "mimeType": "text/csv", "buffer": table.encode()}
        )
        start(page)
        until(page, "page.outbox.acked > 10")
        second_response = clinic.post("/live/code")["code"]
        page.evaluate("() => { document.querySelector('capture-page').outbox.record.token = 'gone'; }")
        page.evaluate("() => document.querySelector('capture-page').link.socket.close()")
        expect(page.get_by_role("alert")).to_contain_text("The pairing has ended", timeout=10_000)
        evaluation = page.evaluate("() => document.querySelector('capture-page').outbox.made")
        page.wait_for_timeout(1000)
        until(page, f"page.outbox.made > {evaluation} + 10", 5)
        pair(page, second_response)
        expect(page.locator("[data-go]")).to_have_text("Stop")
        expect(page.get_by_role("alert")).to_be_hidden()
        until(page, f"page.outbox.acked > {evaluation} + 40")
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=20_000)
    _, streams = read_log(clinic, running)
    samples = np.concatenate([b.samples[:, 0] for b in streams[0]])
    expected = (np.arange(len(samples)) / 1000).astype(np.float32)
    np.testing.assert_array_equal(samples[:, 5], expected)


@pytest.mark.parametrize("fault", ["QuotaExceededError", "UnknownError"])
def test_a_storage_that_refuses_is_told_and_nothing_is_lost_when_it_recovers(
    flat: Browser, running: RunningServer, clinic: Clinic, fault: str
) -> None:
    rows = "t_s," + ",".join(f"L_foot.{k}_{a}" for k in ("acc", "gyr") for a in "xyz")
    table = "\n".join([rows, *(f"{n / 100:.2f},0,0,9.81,0,0,{n / 1000:.3f}" for n in range(3000))])
    with tablet(flat, running) as page:
        pair(page, clinic.code)
        page.locator("[data-files]").set_input_files(
            {"name": "walk.csv", "mimeType": "text/csv", "buffer": table.encode()}
        )
        start(page)
        until(page, "page.outbox.acked > 10")
        page.evaluate(
            """(name) => { const put = IDBObjectStore.prototype.put;
               window.mend = () => { IDBObjectStore.prototype.put = put; };
               IDBObjectStore.prototype.put = () => { throw new DOMException('as a test', name); }; }""",
            fault,
        )
        says = "storage is full" if fault == "QuotaExceededError" else "cannot store data"
        expect(page.get_by_role("alert")).to_contain_text(says, timeout=5000)
        page.evaluate("() => mend()")
        expect(page.get_by_role("alert")).to_be_hidden(timeout=5000)
        page.locator("[data-go]").click()
        expect(page.locator("[data-done]")).to_have_text("Recording is on the server", timeout=20_000)
    _, streams = read_log(clinic, running)
    samples = np.concatenate([b.samples[:, 0] for b in streams[0]])
    np.testing.assert_array_equal(samples[:, 5], (np.arange(len(samples)) / 1000).astype(np.float32))
    assert clinic.take()["problem"] is None
