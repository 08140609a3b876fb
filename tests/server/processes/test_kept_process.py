"""Persistent child process: messages in both directions, and replacement."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from sagittal.server.processes import kept_process
from sagittal.server.processes.kept_process import KeptProcess
from sagittal.server.settings import Settings

pytestmark = pytest.mark.anyio

PATIENCE_S = 60.0
ECHO = """
import socket, struct, sys

line = socket.socket(fileno=int(sys.argv[1])).makefile("rwb")
while head := line.read(8):
    message = line.read(struct.unpack("!Q", head)[0])
    if message != b"be silent":
        line.write(head + message)
        line.flush()
"""
"""Says what it hears, without our libraries."""


class Kept:
    """Persistent process with all its messages and the number of its losses."""

    def __init__(self, folder: Path, greetings: Iterable[bytes]) -> None:
        self.heard: asyncio.Queue[bytes] = asyncio.Queue()
        self.deaths = asyncio.Semaphore(0)
        self.process = KeptProcess(
            "echo_for_tests",
            Settings(data_dir=folder),
            lambda: greetings,
            self.heard.put_nowait,
            self.deaths.release,
        )

    async def next(self) -> bytes:
        return await asyncio.wait_for(self.heard.get(), PATIENCE_S)


@asynccontextmanager
async def keep(folder: Path, monkeypatch: pytest.MonkeyPatch, *greetings: bytes) -> AsyncIterator[Kept]:
    (folder / "echo_for_tests.py").write_text(ECHO)
    monkeypatch.setenv("PYTHONPATH", str(folder))
    retained = Kept(folder, greetings)
    retained.process.start()
    try:
        yield retained
    finally:
        await retained.process.stop()


async def test_it_is_greeted_heard_replaced_when_killed_and_gone_when_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with keep(tmp_path, monkeypatch, b"good", b"morning") as retained:
        assert not retained.process.is_connected
        retained.process.send(b"lost, for there is nobody yet")
        assert [await retained.next(), await retained.next()] == [b"good", b"morning"]
        retained.process.send(b"and you")
        assert await retained.next() == b"and you"
        assert retained.process.backlog_bytes == 0
        first = retained.process.pid
        assert first is not None
        retained.process.is_warm = True
        os.kill(first, signal.SIGKILL)
        await asyncio.wait_for(retained.deaths.acquire(), PATIENCE_S)
        assert not retained.process.is_warm
        # the first death is made good at once
        assert [await retained.next(), await retained.next()] == [b"good", b"morning"]
        second = retained.process.pid
        assert second not in {None, first}
    assert retained.process.pid is None
    assert not retained.process.is_connected
    assert retained.deaths.locked()  # nobody mourns who was stopped


async def test_who_owes_an_answer_and_is_silent_is_replaced_but_only_when_warm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_process, "HUNG_S", 0.0)
    async with keep(tmp_path, monkeypatch, b"hello") as retained:
        await retained.next()
        first = retained.process.pid
        retained.process.is_warm = True
        retained.process.end_if_hung()  # it owes nothing
        retained.process.send(b"be silent")
        retained.process.expect_answer()
        retained.process.is_warm = False
        retained.process.end_if_hung()  # it compiles
        assert retained.process.pid == first
        retained.process.is_warm = True
        retained.process.end_if_hung()
        await asyncio.wait_for(retained.deaths.acquire(), PATIENCE_S)
        await retained.next()
        assert retained.process.pid != first


async def test_an_answer_settles_what_is_owed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_process, "HUNG_S", 0.0)
    async with keep(tmp_path, monkeypatch) as retained:
        while not retained.process.is_connected:
            await asyncio.sleep(0.01)
        first = retained.process.pid
        retained.process.is_warm = True
        retained.process.expect_answer()
        retained.process.send(b"here")
        await retained.next()
        retained.process.end_if_hung()
        assert retained.process.pid == first
