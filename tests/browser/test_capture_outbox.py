"""Batches in the tablet's IndexedDB, in Chromium: reloads, a crash, more data than memory."""

from __future__ import annotations

import base64
import contextlib
import hashlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Error, Page

from sagittal.core.formats.live_log import SampleBatch, encode_batch, read_batch_header
from sagittal.core.formats.live_log import view_samples as payload_of
from tests.browser.conftest import RunningServer

OPEN = """const { Outbox } = await import('/static/js/capture/outbox.js');
    const text = (b) => btoa(Array.from(b, (v) => String.fromCharCode(v)).join(''));
    const hello = { streams: [{ stream: 0, rate_hz: 100, sensors: [{ id: 'A' }] }] };
    const samples = (n) => new Float32Array(45).fill(n);
    const batch = (n) => ({ stream: 0, t0Us: n * 50000, sentUs: n, nImu: 1, samples: samples(n) });"""
BEGIN = OPEN + "const outbox = await Outbox.begin({ take: 't', token: 'k' }); await outbox.note({ hello });"
AGAIN = OPEN + "const outbox = await Outbox.unfinished();"


@pytest.fixture
def context(flat: Browser, running: RunningServer) -> Iterator[BrowserContext]:
    context = flat.new_context(base_url=running.url)
    yield context
    context.close()


def opened(context: BrowserContext) -> Page:
    page = context.new_page()
    page.goto("/static/icon.svg")
    return page


def run(page: Page, body: str) -> Any:
    return page.evaluate(f"async () => {{ {body} }}")


def frame(n: int) -> bytes:
    return encode_batch(SampleBatch(0, n, n * 50_000, n, np.full((5, 1, 9), n, np.float32)))


def digest(count: int) -> str:
    sha256 = hashlib.sha256()
    for n in range(count):
        sha256.update(payload_of(frame(n), read_batch_header(frame(n))))
    return sha256.hexdigest()


def test_more_than_memory_holds_is_read_back_in_order_with_its_hash(context: BrowserContext) -> None:
    page = opened(context)
    run(page, BEGIN + "for (let n = 0; n < 700; n++) outbox.add(batch(n), 100); await outbox.settled();")
    page.reload()
    result = run(
        page,
        AGAIN
        + """const all = [];
        while (all.length < 700) all.push(...await outbox.read(all.length, all.length + 32));
        return { all: all.map(text), made: outbox.made, stored: outbox.stored, acked: outbox.acked,
          held: outbox.heldS, sha: outbox.sha256(), last: outbox.record.lastUs[0] };""",
    )
    assert [base64.b64decode(b) for b in result["all"]] == [frame(n) for n in range(700)]
    assert (result["made"], result["stored"], result["acked"]) == (700, 700, 0)
    assert result["held"] == pytest.approx(35)
    assert result["sha"] == digest(700)
    assert result["last"] == 699 * 50_000 + 40_000


def test_acknowledged_batches_leave_the_tablet_and_the_hash_goes_on(context: BrowserContext) -> None:
    page = opened(context)
    run(
        page,
        BEGIN + "for (let n = 0; n < 30; n++) outbox.add(batch(n), 100);"
        " await outbox.settled(); await outbox.acknowledge(25);",
    )
    page.reload()
    result = run(
        page,
        AGAIN
        + """const acked = outbox.acked, first = (await outbox.read(25, 30)).map(text);
        for (let n = 30; n < 40; n++) outbox.add(batch(n), 100);
        await outbox.settled(); await outbox.acknowledge(40);
        return { acked, first, sha: outbox.sha256(), left: (await outbox.read(0, 40)).length };""",
    )
    assert result["acked"] == 25
    assert [base64.b64decode(b) for b in result["first"]] == [frame(n) for n in range(25, 30)]
    assert result["sha"] == digest(40)
    assert result["left"] == 0
    page.reload()
    assert run(page, AGAIN + "return [outbox.made, outbox.acked];") == [40, 40]


def test_what_was_stored_survives_a_crash_of_the_page(context: BrowserContext) -> None:
    page = opened(context)
    stored: list[int] = []
    page.expose_function("tell", lambda n: stored.append(n))
    run(
        page,
        BEGIN
        + """outbox.onstored = () => tell(outbox.stored); let n = 0;
        setInterval(() => outbox.add(batch(n++), 100), 5);""",
    )
    while not stored or stored[-1] < 60:
        page.wait_for_timeout(50)
    with page.expect_event("crash"), contextlib.suppress(Error):
        page.goto("chrome://crash")
    second_page = opened(context)
    result = run(
        second_page,
        AGAIN + "return [outbox.made, outbox.sha256(), (await outbox.read(0, outbox.made)).length];",
    )
    assert result[0] >= stored[-1] >= 60
    assert result[1] == digest(result[0])
    assert result[2] == result[0]


def test_a_finished_take_leaves_nothing_behind(context: BrowserContext) -> None:
    page = opened(context)
    run(page, BEGIN + "outbox.add(batch(0), 100); await outbox.forget();")
    assert run(page, AGAIN + "return outbox;") is None
