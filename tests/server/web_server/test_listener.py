"""The listening socket of a real server: small answers at once, and no flood without descriptors."""

from __future__ import annotations

import asyncio
import contextlib
import os
import resource
import selectors
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from starlette.types import Receive, Scope, Send

from sagittal.server.web_server.listener import RESERVED, SeldomLog, make_room
from tests.data import ROOT
from tests.helpers.service import line_with
from tests.server.serving import serving

SOON_S = 10.0
GUESTS = 60
FREE = 10
"""Descriptors left to the server."""


async def nothing(scope: Scope, receive: Receive, send: Send) -> None:
    """An application that is never asked."""


@pytest.mark.anyio
async def test_what_is_accepted_sends_small_answers_at_once() -> None:
    async with serving(nothing) as (port, server):
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        async with asyncio.timeout(SOON_S):
            while not server.server_state.connections:
                await asyncio.sleep(0.01)
        (connection,) = server.server_state.connections
        accepted = connection.transport.get_extra_info("socket")
        assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0
        writer.close()
        await writer.wait_closed()


@contextlib.contextmanager
def a_server(folder: Path, log: Path) -> Iterator[tuple[int, int]]:
    """Port and process of `sagittal serve` without workers."""
    with log.open("wb") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "sagittal.server.main", "serve", "--data", str(folder), "--port", "0"],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=stderr, text=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1",
                 "SAGITTAL_WORKERS": "0", "SAGITTAL_LIVE_WORKERS": "0"},
        )  # fmt: skip
    try:
        address = line_with(process, r"http://[\d.:]+")
        yield int(address.rpartition(":")[2]), process.pid
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


def closed_by_the_server(guests: list[socket.socket], at_least: int) -> int:
    """How many of these connections the server has closed, once it is so many."""
    closed, deadline = 0, time.monotonic() + SOON_S
    with selectors.DefaultSelector() as selector:
        for guest in guests:
            selector.register(guest, selectors.EVENT_READ)
        while closed < at_least and time.monotonic() < deadline:
            for key, _ in selector.select(deadline - time.monotonic()):
                assert isinstance(key.fileobj, socket.socket)
                with contextlib.suppress(ConnectionResetError):
                    assert key.fileobj.recv(1) == b""
                selector.unregister(key.fileobj)
                closed += 1
    return closed


def is_alive(port: int) -> bool:
    """Whether the server answers, if need be after it has seen that others have gone."""
    deadline = time.monotonic() + SOON_S
    while time.monotonic() < deadline:
        with contextlib.suppress(httpx.TransportError):
            return httpx.get(f"http://127.0.0.1:{port}/health/live", trust_env=False).status_code == 200
    return False


@pytest.mark.sweep
def test_without_free_descriptors_newcomers_are_closed_and_the_log_stays_short(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with a_server(tmp_path / "data", log) as (port, process):
        used = len(list(Path(f"/proc/{process}/fd").iterdir()))
        resource.prlimit(process, resource.RLIMIT_NOFILE, (used + FREE, used + FREE))
        with contextlib.ExitStack() as until:
            guests = []
            for _ in range(GUESTS):
                guests.append(until.enter_context(socket.create_connection(("127.0.0.1", port), SOON_S)))
                with contextlib.suppress(ConnectionError):  # closed already
                    guests[-1].sendall(b"GET /health/live HTTP/1.1\r\nHost: localhost\r\n")
            assert closed_by_the_server(guests, GUESTS - FREE) >= GUESTS - FREE
        assert is_alive(port)
        text = log.read_text("utf-8")
        assert "No file descriptor is free" in text
        assert len(text.splitlines()) < FREE


def test_the_limit_of_connections_stays_below_that_of_descriptors() -> None:
    initial = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(400, initial[1]), initial[1]))
        room = make_room(100)
        assert room == 100
        assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] >= RESERVED + 3 * room
        room = make_room(10 * initial[1])
        assert 0 < RESERVED + 3 * room <= resource.getrlimit(resource.RLIMIT_NOFILE)[0] <= initial[1]
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, initial)


def test_what_happens_again_and_again_is_said_once_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    seldom = SeldomLog(every_s=1000.0)
    for _ in range(1000):
        seldom.warn("It is full.")
    assert caplog.messages == ["It is full."]
    always = SeldomLog(every_s=0.0)
    always.warn("Again.")
    always.warn("Again.")
    assert caplog.messages == ["It is full.", "Again.", "Again."]
