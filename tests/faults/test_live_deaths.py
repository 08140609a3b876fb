"""Acknowledged batches survive any number of server kills during a trial."""

from __future__ import annotations

import asyncio
import random
import socket
import sys
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest

from sagittal.server.live import client
from sagittal.server.live.client import StreamReport, stream
from sagittal.server.live.pairing import pair
from sagittal.server.live_takes import live
from sagittal.server.live_takes.live_recordings import log_path
from sagittal.server.uploads import recordings
from tests.faults.clinic import Clinic
from tests.faults.forking import Forker
from tests.helpers.engines import on_both_engines
from tests.helpers.live_takes import HELLO, digest, frame, kept_in, stored

pytestmark = on_both_engines

KILLS = {"sqlite": 50, "postgresql": 10}
"""Batches are files on both; on PostgreSQL only the take's beginning and end are other ones."""
LONGEST_LIFE_S = 0.3
EVERY_S = 0.01
PER_FROZEN = 10
"""One of so many kills meets a server that has been given a batch and has not acknowledged it."""


class Server:
    """One server after the other on one data folder and port."""

    def __init__(self, clinic: Clinic, forker: Forker) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._settings = replace(clinic.settings, port=free.getsockname()[1], workers=0, live_workers=0)
        self._forker = forker
        self.start()

    def start(self) -> None:
        """Start one and wait until it answers."""
        self.now = self._forker.start(self._settings)

    def kill(self) -> None:
        """End it without a word."""
        self.now.kill()


async def walking(
    report: StreamReport, over: asyncio.Event, frames: list[bytes], kills: int
) -> AsyncIterator[bytes]:
    """A batch every few milliseconds until it is enough."""
    while not over.is_set() or len(report.ack_s) < kills:
        frames.append(frame(len(frames)))
        yield frames[-1]
        await asyncio.sleep(EVERY_S)


async def kill_again_and_again(
    server: Server, path: Path, report: StreamReport, over: asyncio.Event, frames: list[bytes], kills: int
) -> None:
    chance = random.Random(5)  # noqa: S311 - when to kill
    for number in range(kills):
        if number % 2:  # in the stream; else it may be at its start, in a recovery or in the hello
            count = len(report.ack_s)
            while len(report.ack_s) == count:
                await asyncio.sleep(0.01)
        await asyncio.sleep(chance.uniform(0.0, LONGEST_LIFE_S))
        if number % PER_FROZEN == 1:
            await asyncio.to_thread(server.now.freeze)
            sent = report.sent
            while report.sent == sent:  # what is sent from now on it never reads
                await asyncio.sleep(0.01)
        count = len(report.ack_s)
        await asyncio.to_thread(server.kill)
        retained = stored(path) if path.exists() else []
        assert len(retained) >= count
        assert retained == frames[: len(retained)]
        await asyncio.to_thread(server.start)
    over.set()


def test_fifty_kills_in_one_take_lose_no_acknowledged_batch(
    clinic: Clinic, forker: Forker, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "LONGEST_PAUSE_S", 0.2)
    with clinic.db.write() as c:
        take, code = live.open_take(c, None, clinic.session.id)
    path = log_path(clinic.settings.live, take.id)
    report, frames, kills = StreamReport(), list[bytes](), KILLS[engine]

    async def run() -> None:
        over = asyncio.Event()
        paired = await asyncio.to_thread(pair, server.now.address, code)
        hello = replace(HELLO, take=paired.take)
        streaming = asyncio.create_task(
            stream(paired.socket, paired.token, hello, walking(report, over, frames, kills), report=report)
        )
        killing = asyncio.create_task(kill_again_and_again(server, path, report, over, frames, kills))
        done, _ = await asyncio.wait((streaming, killing), return_when=asyncio.FIRST_EXCEPTION)
        for task in done:
            await task

    server = Server(clinic, forker)
    try:
        asyncio.run(run())
    finally:
        server.kill()

    sys.stdout.write(
        f"{report.sent} batches, {report.resent} sent again, {report.reconnects} reconnections, "
        f"sha256 {report.sha256[:12]}\n"
    )
    assert report.reconnects >= kills / 2 - 1
    assert report.resent >= kills / PER_FROZEN
    assert (report.sent, len(report.ack_s), report.problem) == (len(frames), len(frames), None)
    with clinic.db.read() as c:
        ended = live.get(c, take.id)
        current = recordings.require_current(c, clinic.session.id)
    assert (ended.state, ended.count, ended.problem) == ("finished", len(frames), None)
    assert ended.sha256 == report.sha256 == digest(frames)
    (file,) = current.files
    assert kept_in(clinic.blobs.read(clinic.patient.id, file.sha256)) == frames
