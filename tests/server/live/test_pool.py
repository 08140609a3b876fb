"""Assignment of trials to estimator processes and their messages; the test plays the processes."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import pytest

from sagittal.server.live.messages import (
    Command,
    EstimatorReady,
    FollowTake,
    ForgetTake,
    LogGrown,
    LogProcessed,
    Order,
    Report,
    decode_order,
    encode,
)
from sagittal.server.live.pool import EstimatorPool
from sagittal.server.processes import kept_process
from sagittal.server.processes.channel import frame, read_message
from sagittal.server.settings import Settings

pytestmark = pytest.mark.anyio


@dataclass
class Child:
    """The other end of a line."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter

    async def hear(self) -> Order:
        async with asyncio.timeout(10):
            order: Order = decode_order(await read_message(self.reader))
        return order

    def say(self, report: Report) -> None:
        self.writer.write(frame(encode(report)))


@dataclass
class Stage:
    """Pool with its notices."""

    pool: EstimatorPool
    lines: asyncio.Queue[socket.socket]
    reports: asyncio.Queue[Report] = field(default_factory=asyncio.Queue)
    restarted: asyncio.Queue[list[str]] = field(default_factory=asyncio.Queue)
    over: set[str] = field(default_factory=set)
    children: list[Child] = field(default_factory=list)

    async def child(self) -> Child:
        async with asyncio.timeout(10):
            result = Child(*await asyncio.open_connection(sock=await self.lines.get()))
        self.children.append(result)
        return result


@asynccontextmanager
async def opened(monkeypatch: pytest.MonkeyPatch, workers: int) -> AsyncIterator[Stage]:
    lines: asyncio.Queue[socket.socket] = asyncio.Queue()

    def start(module: str, settings: Settings) -> tuple[subprocess.Popen[bytes], socket.socket]:
        ours, theirs = socket.socketpair()
        lines.put_nowait(theirs)
        return subprocess.Popen(["cat"], stdin=subprocess.PIPE), ours

    def begin(take: str) -> FollowTake | None:
        return None if take in stage.over else FollowTake(take, f"{take}.log", 0, 1.7, "walk", None, None, [])

    monkeypatch.setattr(kept_process, "start_child", start)
    pool = EstimatorPool(
        Settings(live_workers=workers),
        lambda report: stage.reports.put_nowait(report),
        begin,
        lambda takes: stage.restarted.put_nowait(takes),
    )
    stage = Stage(pool, lines)
    pool.start()
    pool.start()  # once
    try:
        yield stage
    finally:
        await pool.stop()
        for child in stage.children:
            child.writer.close()
            with contextlib.suppress(ConnectionError):
                await child.writer.wait_closed()
    assert pool.pids == []


async def test_takes_go_to_the_process_with_the_fewest_and_stay_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with opened(monkeypatch, 2) as stage:
        pool, one, alternative = stage.pool, await stage.child(), await stage.child()
        assert stage.lines.empty()
        assert len(set(pool.pids)) == 2
        for take in "abc":
            pool.follow(take)
        heard = [await one.hear(), await one.hear(), await alternative.hear()]
        assert [o.take for o in heard if isinstance(o, FollowTake)] == ["a", "c", "b"]
        pool.follow("b")  # again, from the start
        repeat = await alternative.hear()
        assert isinstance(repeat, FollowTake)
        assert repeat.take == "b"
        pool.send(Command("b", 3, "pause", True))
        pool.send(Command("unknown", 3, "pause", True))
        pool.leave("b")
        assert [await alternative.hear(), await alternative.hear()] == [
            Command("b", 3, "pause", True),
            ForgetTake("b"),
        ]
        assert [pool.follows(t) for t in "abc"] == [True, False, True]
        pool.follow("d")
        new = await alternative.hear()
        assert isinstance(new, FollowTake)
        assert new.take == "d"


async def test_of_a_growing_log_only_the_newest_length_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    async with opened(monkeypatch, 1) as stage:
        pool, child = stage.pool, await stage.child()
        pool.follow("a")
        pool.follow("b")
        for size in (10, 20, 30):
            pool.grow("a", size)
        pool.grow("b", 5)
        pool.grow("unknown", 1)
        await child.hear(), await child.hear()
        notices = await child.hear()
        assert isinstance(notices, LogGrown)
        assert notices.sizes == {"a": 30, "b": 5}
        pool.grow("a", 40)
        pool.send(Command("a", 0, "start"))  # what was measured before comes before
        first, second = await child.hear(), await child.hear()
        assert isinstance(first, LogGrown)
        assert (first.sizes, second) == ({"a": 40}, Command("a", 0, "start"))


async def test_the_pool_is_ready_when_every_process_is(monkeypatch: pytest.MonkeyPatch) -> None:
    async with opened(monkeypatch, 2) as stage:
        one, alternative = await stage.child(), await stage.child()
        ready = [stage.pool.is_ready]
        for child in (one, alternative):
            child.say(EstimatorReady())
            assert await stage.reports.get() == EstimatorReady()
            ready.append(stage.pool.is_ready)
        assert ready == [False, False, True]
        alternative.say(LogProcessed("a"))
        assert await stage.reports.get() == LogProcessed("a")


async def test_who_takes_the_place_of_one_that_died_follows_what_still_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with opened(monkeypatch, 1) as stage:
        pool, child = stage.pool, await stage.child()
        for take in "cab":
            pool.follow(take)
        stage.over.add("a")
        child.writer.close()
        async with asyncio.timeout(10):
            assert await stage.restarted.get() == ["a", "b", "c"]
        child = await stage.child()
        heard = {getattr(o, "take", "") for o in (await child.hear(), await child.hear())}
        assert heard == {"b", "c"}
        assert [pool.follows(t) for t in "abc"] == [False, True, True]


async def test_without_processes_nobody_estimates(monkeypatch: pytest.MonkeyPatch) -> None:
    async with opened(monkeypatch, 0) as stage:
        stage.pool.follow("a")
        stage.pool.grow("a", 1)
        assert not stage.pool.follows("a")
        assert not stage.pool.is_ready
