"""Concurrent streaming, estimating and watching: no blocking, no repeated messages."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
from collections.abc import AsyncIterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest
from sqlalchemy import select
from websockets.asyncio.client import ClientConnection

from sagittal.core.feedback import Cue
from sagittal.core.formats.live_log import FILE_MARK, hello_json, record
from sagittal.server.clinic import sessions
from sagittal.server.live.client import StreamReport, stream
from sagittal.server.live.estimator import EstimatorWorker
from sagittal.server.live.hub import Hub
from sagittal.server.live.messages import (
    Command,
    EstimateFailed,
    FeedItem,
    FollowTake,
    ForgetTake,
    LogGrown,
    Picture,
)
from sagittal.server.live.messages import Report as Told
from sagittal.server.live.take import STEERING
from sagittal.server.live_takes import live, live_events
from sagittal.server.live_takes.live_recordings import log_path
from sagittal.server.results import prescriptions
from sagittal.server.storage.schema.live_tables import live_event
from sagittal.server.uploads import recordings
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.live_clinic import Visit, heard, new_session, visit
from tests.helpers.live_takes import finish_text
from tests.helpers.live_walk import items, replayed, walk, walk_hello
from tests.server.serving import serve

pytestmark = pytest.mark.anyio

STANCE = {
    "parameter": "stance_pct",
    "side": None,
    "target": {"source": "manual", "mean": 64.0, "sd": 1.5},
    "modes": ["zone", "tone"],
    "schedule": {"kind": "every", "probe_every": 10, "probe_strides": 3},
}


@pytest.fixture(scope="module")
async def estimating(
    tmp_path_factory: pytest.TempPathFactory, anyio_backend: str
) -> AsyncIterator[tuple[Clinic, int]]:
    """A clinic with an estimator that is warm."""
    async with (
        open_clinic(tmp_path_factory.mktemp("estimating"), live_workers=1) as clinic,
        serve(clinic.app) as port,
    ):
        pool = hub_of(clinic).pool
        async with asyncio.timeout(180):
            while not pool.is_ready:
                await asyncio.sleep(0.05)
        yield clinic, port


def hub_of(clinic: Clinic) -> Hub:
    hub: Hub = clinic.app.state.hub
    return hub


def prescribed(clinic: Clinic) -> str:
    """Session of a patient with a prescription."""
    session = new_session(clinic)
    with clinic.db.write() as c:
        patient = sessions.get(c, session).patient_id
        prescriptions.write(c, clinic.app.state.reviewed, None, patient, STANCE)
    return session


async def given(frames: Sequence[bytes], gates: Sequence[asyncio.Event]) -> AsyncIterator[bytes]:
    """Batches sent as fast as accepted, in equal parts with a gate after each but the last."""
    parts = len(gates) + 1
    for i, one in enumerate(frames):
        yield one
        part = (i + 1) * parts / len(frames)
        if part == int(part) and part < parts:
            await gates[int(part) - 1].wait()


def streaming(
    v: Visit, frames: Sequence[bytes], gates: Sequence[asyncio.Event] = ()
) -> asyncio.Task[StreamReport]:
    return asyncio.create_task(stream(v.socket, v.token, walk_hello(v.take), given(frames, gates)))


class Watcher:
    """A browser that keeps everything."""

    def __init__(self, ws: ClientConnection) -> None:
        self.messages: list[dict[str, Any]] = []
        self._ws = ws
        self._changed = asyncio.Condition()
        self._task = asyncio.create_task(self._read())

    async def _read(self) -> None:
        async for text in self._ws:
            self.messages.append(json.loads(text))
            async with self._changed:
                self._changed.notify_all()

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [m for m in self.messages if m["type"] == kind]

    async def until(self, holds: Any, patience_s: float = 60.0) -> None:
        async with asyncio.timeout(patience_s), self._changed:
            await self._changed.wait_for(lambda: holds(self))

    async def stop(self) -> None:
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)


@contextlib.asynccontextmanager
async def watching(v: Visit) -> AsyncIterator[Watcher]:
    async with v.feed() as ws:
        watcher = Watcher(ws)
        try:
            yield watcher
        finally:
            await watcher.stop()


def cue_rows(clinic: Clinic, take: str) -> list[dict[str, Any]]:
    with clinic.db.read() as c:
        query = select(live_event.c.content).where(live_event.c.take_id == take, live_event.c.kind == "cue")
        return list(c.execute(query.order_by(live_event.c.seq)).scalars())


async def drained(clinic: Clinic, take: str) -> None:
    """Wait until the estimator's output is complete and stored."""
    async with asyncio.timeout(20):
        while hub_of(clinic).pool.follows(take):
            await asyncio.sleep(0.05)
    hub_of(clinic).journal.write()


def bytes_of(clinic: Clinic, session: str) -> bytes:
    with clinic.db.read() as c:
        current = recordings.require_current(c, session)
    content: bytes = clinic.app.state.blobs.read(current.patient_id, current.files[0].sha256)
    return content


@pytest.mark.slow
async def test_what_was_told_live_is_what_the_recording_says_commands_and_a_killed_estimator_included(
    estimating: tuple[Clinic, int], tmp_path: Path
) -> None:
    clinic, port = estimating
    frames = [due.frame for due in walk()[:1000]]
    async with visit(clinic, port, prescribed(clinic)) as v, watching(v) as page:
        gates = [asyncio.Event() for _ in range(3)]
        task = streaming(v, frames, gates)
        await page.until(lambda p: p.of("cue"))
        await v.command("level", 1)
        await v.command("feedback", False)
        await v.command("mark", "shoes changed")
        gates[0].set()
        await page.until(lambda p: p.of("cue")[-1]["why_not"] == "off")
        initial_count = len(page.of("cue"))
        for pid in hub_of(clinic).pool.pids:
            os.kill(pid, signal.SIGKILL)
        await page.until(lambda p: any("restarts" in n["text"] for n in p.of("notice")))
        count = len(page.messages)
        gates[1].set()
        await page.until(lambda p: any(m["type"] == "frame" for m in p.messages[count:]))
        await v.command("feedback", True)
        gates[2].set()
        assert (await task).recording
        numbers = [cue["n"] for cue in page.of("cue")]
        assert len(numbers) == len(set(numbers)) >= initial_count > 0
        await drained(clinic, v.take)
    rows = cue_rows(clinic, v.take)
    log = tmp_path / "take.log"
    log.write_bytes(bytes_of(clinic, v.session))
    with clinic.db.read() as c:
        events = live_events.events(c, v.take)
    commands = [
        Command(v.take, e.content["before"], e.kind, e.content["value"]) for e in events if e.kind in STEERING
    ]
    training = next(dict(e.content) for e in events if e.kind == "prescription")
    message = items(replayed(log, training=training, commands=commands), "cue")
    assert [Cue.from_json(row) for row in rows] == [
        Cue.from_json(msgspec.json.decode(one.body)) for one in message
    ]
    assert {cue["why_not"] for cue in rows} >= {"off"}
    assert [e.content["value"] for e in events if e.kind == "mark"] == ["shoes changed"]


@pytest.mark.slow
async def test_a_later_browser_gets_the_state_the_last_frame_and_the_last_strides(
    estimating: tuple[Clinic, int],
) -> None:
    clinic, port = estimating
    done = asyncio.Event()
    async with visit(clinic, port) as v:
        async with watching(v) as page:
            task = streaming(v, [due.frame for due in walk()[:1000]], [done])
            await page.until(lambda p: len(p.of("stride")) > 12)
            await page.until(lambda p: p.of("frame")[-1]["t"] > 24.9)
            first = page.of("frame")[-1]
            strides = {s["n"] for s in page.of("stride")}
            assert first["stage"] == "running"
            assert first["method"] == "erkf"
            assert len(first["health"]) == 7
            assert {row["state"] for row in first["health"]} == {"ok"}
            assert set(first["contact"]) == {"l", "r"}
            assert set(first["trace"]) - {"t"} == set(first["angles_deg"])
            stride = next(s for s in page.of("stride") if s["complete"] and s["counted"])
            assert 0.8 < stride["values"]["stride_time_s"] < 1.4
            assert len(stride["curves_deg"]["knee_flexion"]) == 51
            assert 55 < stride["foot_off_pct"] < 70
        async with watching(v) as late:
            await late.until(lambda p: p.of("frame"))
            assert late.messages[0]["type"] == "state"
            assert late.messages[0]["state"] == "streaming"
            assert late.of("frame")[-1]["t"] >= first["t"]
            assert {s["n"] for s in late.of("stride")} <= strides
            assert len(late.of("stride")) >= 12
        picture = hub_of(clinic).room(v.session).picture
        assert picture is not None
        assert picture.pose is not None
        assert len(picture.pose.q) == 16 * len(picture.pose.segments)
        done.set()
        await task


@pytest.mark.slow
async def test_a_browser_that_does_not_read_delays_nobody(estimating: tuple[Clinic, int]) -> None:
    clinic, port = estimating
    async with visit(clinic, port) as v, v.feed() as lazy, watching(v) as page:
        lazy.transport.pause_reading()
        report = await streaming(v, [due.frame for due in walk()])
        await page.until(lambda p: p.of("state")[-1]["state"] == "finished")
        assert report.recording
        await page.until(lambda p: len({s["n"] for s in p.of("stride")}) > 50)
        assert len(page.of("frame")) > 3
        lazy.transport.resume_reading()
        assert (await heard(lazy, "state", state="finished"))["recording"] == report.recording


@pytest.mark.slow
async def test_a_stopped_estimator_delays_no_acknowledgement(estimating: tuple[Clinic, int]) -> None:
    clinic, port = estimating
    pool = hub_of(clinic).pool
    frames = [due.frame for due in walk()[:400]]
    async with visit(clinic, port) as v:
        async with watching(v) as page:
            task = streaming(v, frames[:60])
            await page.until(lambda p: p.of("frame"))
            single = await task
        async with contextlib.AsyncExitStack() as stack:
            w = await stack.enter_async_context(visit(clinic, port))
            for pid in pool.pids:
                os.kill(pid, signal.SIGSTOP)
            try:
                report = await streaming(w, frames)
            finally:
                for pid in pool.pids:
                    os.kill(pid, signal.SIGCONT)
    assert len(report.ack_s) == 400
    assert report.ack_quantile(0.99) < max(1.0, 3 * single.ack_quantile(0.99))


@pytest.mark.slow
async def test_a_server_that_starts_again_waits_for_the_tablet_and_tells_no_cue_twice(
    tmp_path: Path,
) -> None:
    frames = [due.frame for due in walk()]
    async with open_clinic(tmp_path, live_workers=1) as clinic, serve(clinic.app) as port:
        async with (
            visit(clinic, port, prescribed(clinic)) as v,
            watching(v) as page,
            v.tablet(v.hello(walk_hello(v.take))) as ws,
        ):
            await heard(ws, "welcome")
            for sent in range(60, 601, 60):
                for one in frames[sent - 60 : sent]:
                    await ws.send(one)
                while (await heard(ws, "ack"))["ack"] < sent:
                    pass
            await page.until(lambda p: p.of("cue"))
            await v.command("mark", "before")
            await v.command("pause", True)
        hello, take, session, token = v.hello(walk_hello(v.take)), v.take, v.session, v.token
    first = cue_rows_of(tmp_path, clinic, take)
    assert first
    async with open_clinic(tmp_path, live_workers=1) as clinic, serve(clinic.app) as port:
        second = Visit(clinic, port, session, take, token, v.http)
        standing = hub_of(clinic).take_of(session)
        assert standing is not None
        assert standing.standing()["tablet"] == "lost"
        assert standing.standing()["count"] == sent
        assert [m.value for m in standing.steered.marks] == ["before"]
        async with second.feed("admin") as feed:
            watcher = Watcher(feed)
            async with second.tablet(hello) as ws:
                assert (await heard(ws, "welcome"))["next_seq"] == sent
                for one in frames[sent : sent + 60]:
                    await ws.send(one)
                while (await heard(ws, "ack"))["ack"] < sent + 60:
                    pass
                await watcher.until(lambda p: p.of("feedback") and p.of("feedback")[-1]["paused"])
                await watcher.until(lambda p: p.of("frame")[-1]["t"] > 0.05 * (sent + 50))
                await ws.send(finish_text(frames[: sent + 60]))
                assert (await heard(ws, "finished"))["recording"]
            await watcher.stop()
        await drained(clinic, take)
        rows = cue_rows(clinic, take)
        assert rows[: len(first)] == first
        assert len({row["n"] for row in rows}) == len(rows)
        content = bytes_of(clinic, session)
        assert content.count(b"SAGLIVE1\n") == 1


def cue_rows_of(folder: Path, clinic: Clinic, take: str) -> list[dict[str, Any]]:
    """From the database of a clinic that has stopped."""
    from sagittal.server.storage.db import Database

    db = Database(clinic.settings.database_source)
    try:
        with db.read() as c:
            query = select(live_event.c.content).where(
                live_event.c.take_id == take, live_event.c.kind == "cue"
            )
            return list(c.execute(query.order_by(live_event.c.seq)).scalars())
    finally:
        db.close()


@pytest.mark.slow
@pytest.mark.parametrize("broken", ["copy", "publish"])
async def test_a_crash_while_the_take_becomes_a_recording_is_repaired_at_the_next_start(
    tmp_path: Path, broken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies(*_: object) -> None:
        raise RuntimeError("the power is gone")

    frames = [due.frame for due in walk()[:20]]
    monkeypatch.setattr("sagittal.server.live.hub.GRACE_S", 0.1)
    async with open_clinic(tmp_path, live_workers=0) as clinic, serve(clinic.app) as port:
        with monkeypatch.context() as patch:
            patch.setattr(f"sagittal.server.live_takes.live_recordings._{broken}", dies)
            async with visit(clinic, port) as v, v.tablet(v.hello(walk_hello(v.take))) as ws:
                await heard(ws, "welcome")
                for one in frames:
                    await ws.send(one)
                await ws.send(finish_text(frames))
                async with asyncio.timeout(20):
                    while (state := await v.state())["state"] != "finished":
                        await asyncio.sleep(0.02)
                assert state["recording"] is None
    log = log_path(clinic.settings.live, v.take)
    content = log.read_bytes()
    async with open_clinic(tmp_path, live_workers=0) as clinic:
        with clinic.db.read() as c:
            current = recordings.require_current(c, v.session)
            assert live.get(c, v.take).recording_id == current.id
        assert bytes_of(clinic, v.session) == content
    assert not log.exists()


@pytest.mark.slow
def test_a_take_that_throws_is_told_and_leaves_the_others_alone(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.log", tmp_path / "bad.log"
    whole = FILE_MARK + record("H", hello_json(walk_hello("a" * 32)))
    for due in walk()[:100]:
        whole += record("B", due.frame)
    good.write_bytes(whole)
    bad.write_bytes(b"no log at all" * 100)
    message: list[Told] = []
    estimator = EstimatorWorker(message.append)
    for name, path in (("good", good), ("bad", bad)):
        estimator.obey(FollowTake(name, str(path), 0, 1.75, "walk", None, None, []))
    estimator.obey(FollowTake("gone", str(tmp_path / "gone.log"), 0, 1.75, "walk", None, None, []))
    estimator.obey(LogGrown({"good": len(whole), "bad": 1300, "gone": 5}, 0.0))
    while estimator.has_work:
        estimator.work()
    estimator.obey(ForgetTake("good"))
    broken = {s.take: s.code for s in message if isinstance(s, EstimateFailed)}
    assert broken == {"gone": "live_log_gone", "bad": "live_estimate_failed"}
    view = [s for s in message if isinstance(s, Picture)]
    assert {s.take for s in view} == {"good"}
    assert not [s for s in message if isinstance(s, FeedItem) and s.take != "good"]
    estimator.obey(Command("bad", 0, "pause", True))  # of a take that was given up: nothing to do


@pytest.mark.slow
def test_a_take_without_a_mapped_sensor_is_told_why_it_cannot_be_estimated(tmp_path: Path) -> None:
    hello = walk_hello("a" * 32)
    stream_ = hello.streams[0]
    nothing = tuple(replace(sensor, segment=None) for sensor in stream_.sensors)
    log = tmp_path / "take.log"
    whole = FILE_MARK + record("H", hello_json(replace(hello, streams=(replace(stream_, sensors=nothing),))))
    log.write_bytes(whole + record("B", walk()[0].frame))
    message: list[Told] = []
    estimator = EstimatorWorker(message.append)
    estimator.obey(FollowTake("one", str(log), log.stat().st_size, None, "walk", None, None, []))
    estimator.work()
    (only,) = message
    assert isinstance(only, EstimateFailed)
    assert only.code == "no_mapping"
    assert not estimator.has_work


@pytest.mark.slow
async def test_an_estimator_ends_with_a_killed_server(tmp_path: Path) -> None:
    import subprocess
    import sys

    script = f"""
import asyncio, sys, time
from pathlib import Path
from sagittal.server.live.pool import EstimatorPool
from sagittal.server.settings import Settings
async def main():
    settings = Settings(data_dir=Path({str(tmp_path)!r}))
    pool = EstimatorPool(settings, lambda r: None, lambda t: None, lambda t: None)
    pool.start()
    while not pool.is_ready:
        await asyncio.sleep(0.05)
    print(*pool.pids, flush=True)
    time.sleep(600)
asyncio.run(main())
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    pids = [int(p) for p in (await asyncio.to_thread(process.stdout.readline)).split()]
    assert pids
    process.kill()
    process.wait()
    process.stdout.close()
    async with asyncio.timeout(5):
        while any(Path(f"/proc/{pid}").exists() for pid in pids):
            await asyncio.sleep(0.02)
