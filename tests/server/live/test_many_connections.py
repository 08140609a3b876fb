"""Disconnecting tablets leave no resources behind in the server."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from sagittal.server.live.client import stream
from sagittal.server.live.protocol import ack
from tests.helpers.clinic import Clinic
from tests.helpers.live_clinic import Visit, heard, visit
from tests.helpers.live_takes import finish_text, frame
from tests.server.live.test_client import given, hello, recorded

pytestmark = pytest.mark.anyio

TIMES = 200
GOES = ("silent", "hello, then gone", "hello, batch, then gone", "nonsense", "wrong token", "in order")


def descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


async def come_and_go(v: Visit, mode: str) -> None:
    async with connect(v.socket, compression=None, proxy=None) as ws:
        match mode:
            case "silent":
                ws.transport.abort()
            case "hello, then gone":
                await ws.send(v.hello())
                ws.transport.abort()
            case "hello, batch, then gone":
                await ws.send(v.hello())
                await ws.send(frame(0))
                ws.transport.abort()
            case "nonsense":
                await ws.send(b"\xff" * 100)
                await closed(ws)
            case "wrong token":
                await ws.send(v.hello(token="x"))
                await closed(ws)
            case "in order":
                await ws.send(v.hello())
                await heard(ws, "welcome")


async def closed(ws: ClientConnection) -> None:
    with contextlib.suppress(ConnectionClosed):
        async for _ in ws:
            pass


@pytest.mark.slow
async def test_connections_that_come_and_go_leave_no_descriptor_and_no_task(
    clinic: Clinic, port: int
) -> None:
    async with visit(clinic, port) as v:
        for mode in GOES:  # what is loaded or opened at the first time
            await come_and_go(v, mode)
        async with asyncio.timeout(20):
            while (await v.state())["tablet"] != "lost":
                await asyncio.sleep(0.05)
        files, tasks = descriptors(), len(asyncio.all_tasks())
        for number in range(TIMES):
            await come_and_go(v, GOES[number % len(GOES)])
        async with asyncio.timeout(20):
            while descriptors() > files + 2 or len(asyncio.all_tasks()) > tasks + 2:
                await asyncio.sleep(0.05)
        assert (await v.state())["tablet"] == "lost"


@pytest.mark.slow
async def test_a_tablet_that_reads_nothing_gets_acknowledgements_that_replace_each_other(
    clinic: Clinic, port: int
) -> None:
    frames = [frame(i) for i in range(64)]
    async with visit(clinic, port) as v, v.tablet() as lazy:
        await heard(lazy, "welcome")
        lazy.transport.pause_reading()
        for one in frames:
            await lazy.send(one)
            await asyncio.sleep(0.005)
        for _ in range(2000):  # duplicates: each is answered
            await lazy.send(frames[0])
        lazy.transport.resume_reading()
        while await lazy.recv() != ack(64):
            pass
        await lazy.send(finish_text(frames))
        await heard(lazy, "finished")
    assert recorded(clinic, v) == frames


@pytest.mark.slow
async def test_many_tablets_at_once_are_kept_apart(clinic: Clinic, port: int) -> None:
    frames = [[frame(i, n=1 + k) for i in range(30)] for k in range(12)]

    async def one(k: int) -> list[bytes]:
        async with visit(clinic, port) as v:
            await stream(v.socket, v.token, hello(v), given(frames[k], 0.005))
            return recorded(clinic, v)

    assert await asyncio.gather(*(one(k) for k in range(12))) == frames
