"""Sender state against a scripted server."""

from __future__ import annotations

import asyncio
import contextlib
import json
import random
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping, Sequence
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from sagittal.server.live.sender import LiveError, Sender, StreamFaults, StreamReport
from tests.helpers.live_takes import digest, frame

pytestmark = pytest.mark.anyio
FRAMES = [frame(i) for i in range(5)]
Part = Callable[[ServerConnection], Coroutine[Any, Any, None]]


async def given(frames: Sequence[bytes]) -> AsyncIterator[bytes]:
    for one in frames:
        yield one


def welcome(next_seq: int = 0, most: int = 100) -> str:
    return json.dumps({"type": "welcome", "next_seq": next_seq, "max_unacked": most})


class Said:
    """Messages passed on by the sender."""

    def __init__(self) -> None:
        self.messages: list[Mapping[str, Any]] = []


async def play(*parts: Part, said: Said | None = None) -> Sender:
    """Connect once for each part."""
    heard = said or Said()
    sender = Sender("hello", StreamFaults(), heard.messages.append, random.Random(1), StreamReport())  # noqa: S311
    producing = sender.start(given(FRAMES))
    await producing
    for part in parts:
        async with serve(part, "127.0.0.1", 0) as server, asyncio.timeout(10):
            port = server.sockets[0].getsockname()[1]
            async with connect(f"ws://127.0.0.1:{port}", proxy=None) as ws:
                with contextlib.suppress(ConnectionClosed):
                    await sender.serve(ws)
    return sender


async def finish(ws: ServerConnection, batches: int) -> None:
    """Take the hello, so many batches and the finish."""
    assert await ws.recv() == "hello"
    await ws.send(welcome(len(FRAMES) - batches))
    got = [await ws.recv() for _ in range(batches)]
    assert got == FRAMES[len(FRAMES) - batches :]
    end = json.loads(await ws.recv())
    assert (end["count"], end["sha256"]) == (len(FRAMES), digest(FRAMES))
    await ws.send(json.dumps({"type": "finished", "recording": "r1"}))
    await ws.wait_closed()


async def test_all_is_sent_once_and_the_finish_says_how_much_and_what() -> None:
    async def part(ws: ServerConnection) -> None:
        await finish(ws, 5)

    sender = await play(part)
    report = sender.report
    assert (report.sent, report.resent, report.reconnects, report.recording) == (5, 0, 0, "r1")
    assert (report.sha256, report.problem, sender.waiting, sender.finished) == (digest(FRAMES), None, 0, True)
    assert len(report.ack_s) == 5


async def test_after_a_break_it_goes_on_where_the_server_is() -> None:
    async def breaks(ws: ServerConnection) -> None:
        await ws.recv()
        await ws.send(welcome(0, most=3))
        for _ in range(3):
            await ws.recv()
        await ws.send(json.dumps({"type": "ack", "ack": 1}))
        await ws.recv()
        await ws.close()

    async def goes_on(ws: ServerConnection) -> None:
        await finish(ws, 3)

    message = Said()
    sender = await play(breaks, goes_on, said=message)
    assert (sender.report.sent, sender.report.resent, sender.report.reconnects) == (5, 2, 1)
    assert message.messages == []


async def test_no_more_is_sent_than_the_server_takes_unacknowledged() -> None:
    async def part(ws: ServerConnection) -> None:
        await ws.recv()
        await ws.send(welcome(0, most=2))
        got = [await ws.recv() for _ in range(2)]
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(ws.recv(), 0.05)
        await ws.send(json.dumps({"type": "note", "words": "hold on"}))
        await ws.send(json.dumps({"type": "ack", "ack": 2}))
        got += [await ws.recv() for _ in range(2)]
        assert got == FRAMES[:4]
        await ws.close()

    message = Said()
    sender = await play(part, said=message)
    assert (sender.report.sent, sender.waiting) == (4, 3)
    assert [m["words"] for m in message.messages] == ["hold on"]


@pytest.mark.parametrize(
    ("answers", "code"),
    [
        ([welcome(1)], "other_sender"),
        ([welcome(), json.dumps({"type": "finished", "recording": "r"})], "take_ended"),
    ],
)
async def test_what_cannot_go_on_ends_with_its_reason(answers: list[str], code: str) -> None:
    async def part(ws: ServerConnection) -> None:
        await ws.recv()
        for one in answers:
            await ws.send(one)
        await ws.wait_closed()

    with pytest.raises(LiveError) as refused:
        await play(part)
    assert refused.value.code == code


async def test_a_server_that_lost_what_it_had_acknowledged_is_not_believed() -> None:
    async def takes(ws: ServerConnection) -> None:
        await ws.recv()
        await ws.send(welcome(0, most=2))
        await ws.recv()
        await ws.send(json.dumps({"type": "ack", "ack": 1}))
        await ws.recv()
        await ws.close()

    async def forgot(ws: ServerConnection) -> None:
        await ws.recv()
        await ws.send(welcome(0))
        await ws.wait_closed()

    with pytest.raises(LiveError, match="batch 0 again") as refused:
        await play(takes, forgot)
    assert refused.value.code == "acknowledged_lost"


@pytest.mark.parametrize(("share", "value"), [(0.0, 1.0), (0.5, 3.0), (0.99, 4.0), (1.0, 4.0)])
def test_a_quantile_is_one_of_the_times(share: float, value: float) -> None:
    assert StreamReport(ack_s=[4.0, 2.0, 1.0, 3.0]).ack_quantile(share) == value
    assert StreamReport().ack_quantile(share) != StreamReport().ack_quantile(share)  # NaN
