"""Estimators warm up with the server, and the first trial does not wait for them."""

from __future__ import annotations

import asyncio
import subprocess
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from socket import socketpair
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection

from sagittal.server.live import ending, estimator
from sagittal.server.live.hub import Hub
from sagittal.server.live.messages import (
    EstimateFailed,
    FollowTake,
    ForgetTake,
    LogGrown,
    decode_report,
    encode,
)
from sagittal.server.live.pool import MODULE
from sagittal.server.live_takes.live_recordings import log_path
from sagittal.server.processes.channel import Channel
from tests.data import ROOT
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.live_clinic import heard, visit
from tests.helpers.live_takes import finish_text
from tests.helpers.live_walk import walk, walk_hello
from tests.server.live.unready_estimator import UNTIL
from tests.server.serving import serve

pytestmark = pytest.mark.anyio

PATIENCE_S = 180.0
BATCHES = 60
BATCH_S = 0.05
"""Of the walk."""


async def until(holds: Any) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not holds():
            await asyncio.sleep(0.02)


@pytest.mark.slow
async def test_an_estimator_is_warmed_at_the_start_of_the_server_in_a_process_of_its_own(
    tmp_path: Path,
) -> None:
    async with open_clinic(tmp_path, live_workers=1) as clinic:
        hub: Hub = clinic.app.state.hub
        await until(lambda: hub.pool.is_ready)
        assert len(hub.pool.pids) == 1


@pytest.fixture
async def unready(
    tmp_path: Path, anyio_backend: str, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[tuple[Clinic, int, Path]]:
    """A clinic whose estimator is still compiling until a file is made."""
    start = subprocess.Popen

    def other(words: list[str], *args: Any, **options: Any) -> Any:
        changed = ["tests.server.live.unready_estimator" if w == MODULE else w for w in words]
        if changed != words:
            options["env"] = {**options["env"], "PYTHONPATH": str(ROOT)}
        return start(changed, *args, **options)

    compiled = tmp_path / "compiled"
    monkeypatch.setattr(subprocess, "Popen", other)
    monkeypatch.setenv(UNTIL, str(compiled))
    monkeypatch.setattr(ending, "DRAIN_S", 0.1)
    async with open_clinic(tmp_path / "data", live_workers=1) as clinic, serve(clinic.app) as port:
        yield clinic, port, compiled


async def walking(ws: ClientConnection) -> None:
    """Stream a walk in real time while anybody is watching."""
    for one in walk():
        await ws.send(one.frame)
        await asyncio.sleep(BATCH_S)


@pytest.mark.slow
async def test_clock_and_sensors_are_told_before_the_estimator_is_ready(
    unready: tuple[Clinic, int, Path],
) -> None:
    clinic, port, _ = unready
    async with visit(clinic, port) as v, v.feed() as page:
        hello = walk_hello(v.take)
        segments = {s.id: s.segment for stream in hello.streams for s in stream.sensors}
        async with v.tablet(v.hello(hello)) as ws:
            await heard(ws, "welcome")
            feet = asyncio.create_task(walking(ws))
            notices = await heard(page, "state", state="streaming")
            while not notices["elapsed_s"] or notices["elapsed_s"] < 1.0:
                notices = await heard(page, "state")
            marked = await v.command("mark", "stumbled")
            polled = await v.state()
            feet.cancel()
    assert not clinic.app.state.hub.pool.is_ready
    assert notices["estimate"] == polled["estimate"] == "preparing"
    assert {row["id"]: row["segment"] for row in notices["sensors"]} == segments
    assert {row["state"] for row in notices["sensors"]} == {"ok"}
    assert {row["lost_pct"] for row in notices["sensors"]} == {None}, "nobody has counted yet: not zero"
    # a batch may arrive between counting and looking at the clock
    assert notices["elapsed_s"] == pytest.approx(notices["count"] * BATCH_S, abs=2 * BATCH_S)
    assert notices["elapsed_s"] - BATCH_S <= marked["marks"][0]["t_s"] <= polled["elapsed_s"] + BATCH_S


@pytest.mark.slow
async def test_a_take_that_ended_before_the_estimator_was_ready_leaves_no_error(
    unready: tuple[Clinic, int, Path], capfd: pytest.CaptureFixture[str]
) -> None:
    clinic, port, compiled = unready
    hub: Hub = clinic.app.state.hub
    frames = [due.frame for due in walk()[:BATCHES]]
    async with visit(clinic, port) as v, v.feed() as page:
        async with v.tablet(v.hello(walk_hello(v.take))) as ws:
            await heard(ws, "welcome")
            for one in frames:
                await ws.send(one)
            await ws.send(finish_text(frames))
            assert (await heard(ws, "finished"))["recording"]
        log = log_path(clinic.settings.live, v.take)
        await until(lambda: not log.exists())
        compiled.touch()
        await until(lambda: hub.pool.is_ready)
        # another take is followed: what was ordered before it is done with
        async with (
            visit(clinic, port) as w,
            w.feed() as other_feed,
            w.tablet(w.hello(walk_hello(w.take))) as ws,
        ):
            await heard(ws, "welcome")
            for one in frames:
                await ws.send(one)
            await heard(other_feed, "frame")
        assert (await heard(page, "state"))["estimate"] != "failed"
    assert "Traceback" not in capfd.readouterr().err


def test_a_log_that_is_gone_is_told_in_a_sentence(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    ours, theirs = socketpair()
    web, line = Channel(ours), Channel(theirs)
    missing = FollowTake("a" * 32, str(tmp_path / "gone.log"), 100, None, "walk", None, None, [])
    for order in (
        missing,
        ForgetTake(missing.take),
        FollowTake("b" * 32, *vars_of(missing)),
        LogGrown({"b" * 32: 200}, 0.0),
    ):
        web.send(encode(order))
    message: list[EstimateFailed] = []
    with pytest.raises((EOFError, ConnectionError)):
        follow_until_closed(line, web, message)
    assert [(report.take, report.code) for report in message] == [("b" * 32, "live_log_gone")]
    assert not caplog.records


def vars_of(begin: FollowTake) -> tuple[Any, ...]:
    """All but the take."""
    return tuple(getattr(begin, name) for name in begin.__struct_fields__[1:])


def follow_until_closed(line: Channel, web: Channel, message: list[EstimateFailed]) -> None:
    """Follow until the first report, then close the web's side."""

    def read() -> None:
        report = decode_report(web.receive())
        assert isinstance(report, EstimateFailed)
        message.append(report)
        web.close()

    reader = threading.Thread(target=read)
    reader.start()
    try:
        estimator.follow(line)
    finally:
        reader.join()
        line.close()
