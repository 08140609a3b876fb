"""What the tablet was told is kept is kept, however often the server is killed in the middle of a take."""

from __future__ import annotations

import asyncio
import os
import random
import signal
import socket
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from server.live import client
from server.live.client import StreamReport, stream
from server.live.pairing import pair
from server.processes.environment import make_environment
from server.services import live, recordings
from server.services.live_recordings import log_path
from tests.data import ROOT
from tests.faults.clinic import Clinic, until
from tests.live_takes import HELLO, digest, frame, kept_in, stored

KILLS = 50
LONGEST_LIFE_S = 0.3
EVERY_S = 0.01


class Server:
    """One server after the other on one data folder and port."""

    def __init__(self, clinic: Clinic) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        settings = replace(clinic.settings, port=self.port, workers=0, live_workers=0)
        self.forker = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.forked_server"],
            env=make_environment(settings) | {"PYTHONPATH": str(ROOT)},
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.pid: int | None = None

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Start one and wait until it answers."""
        assert self.forker.stdin is not None
        self.forker.stdin.write("\n")
        self.forker.stdin.flush()
        said = {self._line(), self._line()}
        self.pid = next(int(line.split()[1]) for line in said if line.startswith("pid"))
        assert f"at {self.address}" in said

    def kill(self) -> None:
        assert self.pid is not None
        pid, self.pid = self.pid, None
        os.kill(pid, signal.SIGKILL)
        # gone altogether: a zombie may have a thread in a sync, which holds the lock of the folder
        until(lambda: not Path(f"/proc/{pid}").exists())

    def end(self) -> None:
        if self.pid is not None:
            self.kill()
        self.forker.kill()
        self.forker.communicate()

    def _line(self) -> str:
        assert self.forker.stdout is not None
        line = self.forker.stdout.readline().strip()
        assert line.startswith(("pid", "at")), f"the server did not start: {line}"
        return line


@contextmanager
def a_server(clinic: Clinic) -> Iterator[Server]:
    server = Server(clinic)
    try:
        yield server
    finally:
        server.end()


async def walking(report: StreamReport, over: asyncio.Event, frames: list[bytes]) -> AsyncIterator[bytes]:
    """A batch every few milliseconds until it is enough."""
    while not over.is_set() or len(report.ack_s) < KILLS:
        frames.append(frame(len(frames)))
        yield frames[-1]
        await asyncio.sleep(EVERY_S)


async def kill_again_and_again(
    server: Server, path: Path, report: StreamReport, over: asyncio.Event, frames: list[bytes]
) -> None:
    chance = random.Random(5)  # noqa: S311 - when to kill
    for number in range(KILLS):
        if number % 2:  # in the stream; else it may be at its start, in a recovery or in the hello
            told = len(report.ack_s)
            while len(report.ack_s) == told:
                await asyncio.sleep(0.01)
        await asyncio.sleep(chance.uniform(0.0, LONGEST_LIFE_S))
        told = len(report.ack_s)
        await asyncio.to_thread(server.kill)
        kept = stored(path) if path.exists() else []
        assert len(kept) >= told
        assert kept == frames[: len(kept)]
        await asyncio.to_thread(server.start)
    over.set()


def test_fifty_kills_in_one_take_lose_no_acknowledged_batch(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "LONGEST_PAUSE_S", 0.2)
    with clinic.db.write() as c:
        take, code = live.open_take(c, None, clinic.session.id)
    path = log_path(clinic.settings.live, take.id)
    report, frames = StreamReport(), list[bytes]()

    async def run() -> None:
        over = asyncio.Event()
        paired = await asyncio.to_thread(pair, server.address, code)
        hello = replace(HELLO, take=paired.take)
        streaming = asyncio.create_task(
            stream(paired.socket, paired.token, hello, walking(report, over, frames), report=report)
        )
        killing = asyncio.create_task(kill_again_and_again(server, path, report, over, frames))
        done, _ = await asyncio.wait((streaming, killing), return_when=asyncio.FIRST_EXCEPTION)
        for task in done:
            await task

    with a_server(clinic) as server:
        server.start()
        asyncio.run(run())

    sys.stdout.write(
        f"{report.sent} batches, {report.resent} sent again, {report.reconnects} reconnections, "
        f"sha256 {report.sha256[:12]}\n"
    )
    assert report.reconnects >= KILLS / 2 - 1
    assert report.resent > 0
    assert (report.sent, len(report.ack_s), report.problem) == (len(frames), len(frames), None)
    with clinic.db.read() as c:
        ended = live.get(c, take.id)
        made = recordings.require_current(c, clinic.session.id)
    assert (ended.state, ended.count, ended.problem) == ("finished", len(frames), None)
    assert ended.sha256 == report.sha256 == digest(frames)
    (file,) = made.files
    assert kept_in(clinic.blobs.read(clinic.patient.id, file.sha256)) == frames
