"""Live client against a running server: no data loss, complete messages."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from dataclasses import replace

import pytest

from sagittal.core.formats.live_log import Hello
from sagittal.server.live import client
from sagittal.server.live.client import LiveError, StreamFaults, StreamReport, stream
from sagittal.server.live_takes import live
from sagittal.server.uploads import recordings
from tests.helpers.clinic import Clinic
from tests.helpers.live_clinic import Visit, visit
from tests.helpers.live_takes import HELLO, digest, frame, kept_in

pytestmark = pytest.mark.anyio


async def given(frames: Sequence[bytes], pause_s: float = 0.0) -> AsyncIterator[bytes]:
    for one in frames:
        await asyncio.sleep(pause_s)
        yield one


def hello(v: Visit) -> Hello:
    return replace(HELLO, take=v.take)


def recorded(clinic: Clinic, v: Visit) -> list[bytes]:
    """The batches of the recording that the take has become."""
    with clinic.db.read() as c:
        current = recordings.require_current(c, v.session)
    (file,) = current.files
    return kept_in(clinic.app.state.blobs.read(current.patient_id, file.sha256))


@pytest.mark.slow
async def test_a_stream_is_recorded_as_it_was_sent(clinic: Clinic, port: int) -> None:
    frames = [frame(i) for i in range(40)]
    async with visit(clinic, port) as v:
        report = await stream(v.socket, v.token, hello(v), given(frames))
    assert (report.sent, report.resent, report.reconnects, report.problem) == (40, 0, 0, None)
    assert len(report.ack_s) == 40
    assert 0.0 < report.ack_quantile(0.5) <= report.ack_quantile(0.99) < 5.0
    assert report.sha256 == digest(frames)
    assert report.recording
    assert recorded(clinic, v) == frames


@pytest.mark.slow
async def test_a_connection_that_keeps_breaking_loses_nothing(clinic: Clinic, port: int) -> None:
    frames = [frame(i) for i in range(150)]
    async with visit(clinic, port) as v:
        report = await stream(
            v.socket, v.token, hello(v), given(frames, 0.002), faults=StreamFaults(0.08, 0.002), seed=5
        )
    assert report.reconnects >= 5
    assert report.sent == len(report.ack_s) == 150
    assert recorded(clinic, v) == frames


async def test_more_than_may_be_unacknowledged_waits(clinic: Clinic, port: int) -> None:
    frames = [frame(i) for i in range(300)]
    async with visit(clinic, port) as v:
        report = await stream(v.socket, v.token, hello(v), given(frames))
    assert (report.sent, report.reconnects) == (300, 0)
    assert recorded(clinic, v) == frames


async def test_commands_are_handed_on(clinic: Clinic, port: int) -> None:
    heard: list[object] = []

    async def frames(v: Visit) -> AsyncIterator[bytes]:
        yield frame(0)
        while (await v.state())["tablet"] != "connected":
            await asyncio.sleep(0.02)
        await v.command("start")
        while not heard:
            await asyncio.sleep(0.02)

    async with visit(clinic, port) as v:
        await stream(v.socket, v.token, hello(v), frames(v), hear=lambda m: heard.append(m.get("command")))
    assert "start" in heard


async def test_a_wrong_token_ends_it_at_once(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        with pytest.raises(LiveError) as refused:
            await stream(v.socket, "wrong", hello(v), given([frame(0)]))
    assert refused.value.code == "token_not_valid"


async def test_a_batch_the_server_cannot_read_ends_it_with_its_reason(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        with pytest.raises(LiveError) as refused:
            await stream(v.socket, v.token, hello(v), given([frame(0, stream=9)]))
    assert refused.value.code == "batch_stream"
    assert "names 0, 3" in refused.value.message


async def test_an_error_of_the_source_ends_it(clinic: Clinic, port: int) -> None:
    async def broken() -> AsyncIterator[bytes]:
        yield frame(0)
        await asyncio.sleep(0.3)
        raise ZeroDivisionError

    async with visit(clinic, port) as v:
        with pytest.raises(ZeroDivisionError):
            await asyncio.wait_for(stream(v.socket, v.token, hello(v), broken()), 20)


async def test_a_take_that_the_therapist_ends_is_said(clinic: Clinic, port: int) -> None:
    report = StreamReport()

    async def endless() -> AsyncIterator[bytes]:
        for i in range(10_000):
            yield frame(i)
            await asyncio.sleep(0.01)

    async with visit(clinic, port) as v:
        streaming = asyncio.create_task(stream(v.socket, v.token, hello(v), endless(), report=report))
        while not report.ack_s:
            await asyncio.sleep(0.02)
        (await v.http.post(f"{v.api}/close")).raise_for_status()
        with pytest.raises(LiveError) as refused:
            await asyncio.wait_for(streaming, 20)
    assert refused.value.code == "take_ended"
    with clinic.db.read() as c:
        assert live.get(c, v.take).state == "closed"
    stored_recording = recorded(clinic, v)
    assert len(report.ack_s) <= len(stored_recording)
    assert stored_recording == [frame(i) for i in range(len(stored_recording))]


async def test_a_take_of_another_sender_is_not_continued(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        report = StreamReport()
        first = asyncio.create_task(
            stream(v.socket, v.token, hello(v), given([frame(i) for i in range(99)], 0.05), report=report)
        )
        while len(report.ack_s) < 3:
            await asyncio.sleep(0.02)
        first.cancel()
        await asyncio.gather(first, return_exceptions=True)
        with pytest.raises(LiveError) as refused:
            await stream(v.socket, v.token, hello(v), given([frame(0)]))
    assert refused.value.code == "other_sender"


async def test_a_server_that_is_not_there_is_given_up_after_the_patience(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(client, "LONGEST_PAUSE_S", 0.1)
    with pytest.raises(LiveError) as refused:
        await stream("ws://127.0.0.1:9/api/v1/live", "t", HELLO, given([frame(0)]), patience_s=0.3)
    assert refused.value.code == "unreachable"
    assert "0.3 s" in refused.value.message


async def test_an_address_that_is_no_live_socket_is_said(clinic: Clinic, port: int) -> None:
    with pytest.raises(LiveError) as refused:
        await stream(f"ws://127.0.0.1:{port}/elsewhere", "t", HELLO, given([frame(0)]))
    assert refused.value.code == "refused_connection"
