"""A take on its way to the disk: acknowledged means synced, and nothing makes the event loop wait."""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from sagittal.core.errors import InputError
from sagittal.server.live.committer import Committer
from sagittal.server.live.protocol import MAX_UNACKED, MOST_UNACKED, CloseCode, ProtocolError
from sagittal.server.live.recorder import Recorder, open_recorder
from sagittal.server.storage import fs
from tests.faults.failing import FailingSystem
from tests.helpers.live_takes import HELLO, Heard, digest, finish_text, frame, stored


@asynccontextmanager
async def recording(path: Path, interval_s: float = 0.02) -> AsyncIterator[tuple[Recorder, Heard]]:
    heard = Heard()
    committer = Committer(interval_s)
    committer.start()
    recorder = await open_recorder(path, HELLO, committer, heard)
    try:
        yield recorder, heard
    finally:
        await recorder.close()
        committer.stop()


async def until(true: Callable[[], object], patience_s: float = 20.0) -> None:
    limit = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < limit, "waited in vain"
        await asyncio.sleep(0.002)


def test_what_is_acknowledged_is_in_the_log_and_survives_a_new_start(tmp_path: Path) -> None:
    path = tmp_path / "live" / "t.log"

    async def run() -> None:
        async with recording(path) as (recorder, heard):
            for i in range(10):
                assert recorder.offer(frame(i)).close is None
            await until(lambda: recorder.durable == 10)
            assert heard.acks == sorted(heard.acks)
            assert heard.acks[-1] == 10
            assert heard.sizes[-1] == recorder.size == path.stat().st_size
        async with recording(path) as (repeat, heard):
            assert (repeat.next_seq, repeat.durable, heard.acks) == (10, 10, [])
            repeat.offer(frame(10))
            await until(lambda: heard.acks == [11])
        assert stored(path) == [frame(i) for i in range(11)]

    asyncio.run(run())


def test_a_group_is_synced_once_and_within_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[float] = []

    class Counting(fs.System):
        def fsync(self, fd: int) -> None:
            synced.append(time.monotonic())
            super().fsync(fd)

    async def run() -> None:
        async with recording(tmp_path / "t.log", interval_s=0.2) as (recorder, heard):
            monkeypatch.setattr(fs, "system", Counting())
            began = time.monotonic()
            for i in range(30):
                recorder.offer(frame(i))
            await until(lambda: heard.sizes)
            assert not heard.acks  # it can be read long before it is durable
            await until(lambda: heard.acks)
            waited = time.monotonic() - began
            assert heard.acks == [30]
            assert len(synced) == 1
            assert waited > 0.15

    asyncio.run(run())


def test_the_finish_is_told_once_it_is_durable_and_again_when_asked_again(tmp_path: Path) -> None:
    frames = [frame(i) for i in range(4)]

    async def run() -> None:
        async with recording(tmp_path / "t.log") as (recorder, heard):
            for one in frames:
                recorder.offer(one)
            assert recorder.offer(finish_text(frames)).ended is None
            await until(lambda: heard.ends)
            assert recorder.end == heard.ends[0]
            assert (recorder.end.count, recorder.end.sha256) == (4, digest(frames))
        async with recording(tmp_path / "t.log") as (repeat, heard):
            assert repeat.greet(HELLO).close is None
            assert repeat.offer(finish_text(frames)).ended == repeat.end != None  # noqa: E711
            assert repeat.offer(frame(4)).close is CloseCode.ENDED
            assert not heard.ends

    asyncio.run(run())


def test_the_server_ends_a_take_whose_tablet_is_gone(tmp_path: Path) -> None:
    async def run() -> None:
        async with recording(tmp_path / "t.log") as (recorder, _):
            recorder.offer(frame(0))
        heard = Heard()
        committer = Committer(0.02)
        committer.start()
        recorder = await open_recorder(tmp_path / "t.log", None, committer, heard)
        recorder.finish()
        await until(lambda: heard.ends)
        assert (heard.ends[0].count, heard.ends[0].problem) == (1, None)
        await recorder.close()
        committer.stop()

    asyncio.run(run())


def test_a_take_without_a_log_needs_a_hello(tmp_path: Path) -> None:
    async def run() -> None:
        with pytest.raises(ProtocolError) as refused:
            await open_recorder(tmp_path / "t.log", None, Committer(), Heard())
        assert (refused.value.code, refused.value.close) == ("take_empty", CloseCode.ENDED)

    asyncio.run(run())


def test_a_file_that_is_no_log_is_refused_and_left(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    path.write_bytes(b"precious")

    async def run() -> None:
        with pytest.raises(InputError) as refused:
            await open_recorder(path, HELLO, Committer(), Heard())
        assert refused.value.code == "live_log_damaged"

    asyncio.run(run())
    assert path.read_bytes() == b"precious"


def test_a_stalled_disk_holds_up_nobody_and_bounds_what_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    goes_on = threading.Event()

    class Stalled(fs.System):
        def write(self, fd: int, data: bytes | memoryview) -> int:
            assert goes_on.wait(30), "the answers waited for the disk"
            return super().write(fd, data)

    async def run() -> None:
        async with recording(tmp_path / "t.log") as (recorder, heard):
            monkeypatch.setattr(fs, "system", Stalled())
            frames = [frame(i) for i in range(MOST_UNACKED + 1)]
            answers = [recorder.offer(one) for one in frames]
            goes_on.set()
            assert all(a.close is None for a in answers[:-1])
            assert answers[-1].close is CloseCode.TOO_MANY
            assert recorder.next_seq == MOST_UNACKED > MAX_UNACKED
            monkeypatch.setattr(fs, "system", fs.System())
            await until(lambda: heard.acks and heard.acks[-1] == MOST_UNACKED)

    asyncio.run(run())


def test_many_takes_share_one_thread(tmp_path: Path) -> None:
    async def run() -> None:
        committer = Committer(0.02)
        committer.start()
        heard = [Heard() for _ in range(20)]
        paths = [tmp_path / f"{i}.log" for i in range(20)]
        takes = [await open_recorder(p, HELLO, committer, h) for p, h in zip(paths, heard, strict=True)]
        for i in range(15):
            for take in takes:
                take.offer(frame(i))
            await asyncio.sleep(0.003)
        await until(lambda: all(h.acks and h.acks[-1] == 15 for h in heard))
        for take in takes:
            await take.close()
        committer.stop()
        assert all(stored(p) == [frame(i) for i in range(15)] for p in paths)

    asyncio.run(run())


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(errno.ENOSPC, "storage_full"), (errno.EIO, "storage_failed")])
@pytest.mark.parametrize("call", range(1, 9))
def test_a_disk_that_refuses_is_said_and_acknowledges_nothing_that_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: int, number: int, code: str
) -> None:
    frames = [frame(i) for i in range(12)]

    async def run() -> None:
        async with recording(tmp_path / "t.log", interval_s=0.005) as (recorder, heard):
            recorder.offer(frames[0])
            await until(lambda: heard.acks == [1])
            disk = FailingSystem(call, number)
            monkeypatch.setattr(fs, "system", disk)
            i = 1
            while not heard.failures:
                assert i < len(frames), "the disk never failed"
                recorder.offer(frames[i])
                i += 1
                await until(lambda: heard.failures or heard.acks[-1] == i)  # noqa: B023
            assert [(f.code, f.close) for f in heard.failures] == [(code, CloseCode.STORAGE)]
            answer = recorder.offer(frame(recorder.next_seq))
            assert (answer.close, answer.reason) == (CloseCode.STORAGE, code)
            assert recorder.greet(HELLO).reason == code
            sure = heard.acks[-1]
            monkeypatch.setattr(fs, "system", fs.System())
            await recorder.reopen()
            assert recorder.failure is None
            assert recorder.next_seq == recorder.durable == sure
            assert heard.sizes[-1] == recorder.size
            for one in frames[sure:]:
                assert recorder.offer(one).close is None
            recorder.offer(finish_text(frames))
            await until(lambda: heard.ends)
            assert heard.ends[0].problem is None
        assert stored(tmp_path / "t.log") == frames

    asyncio.run(run())


def test_a_disk_that_still_refuses_is_tried_again_at_the_next_hello(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(fs.System):
        def write(self, fd: int, data: bytes | memoryview) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        def truncate(self, fd: int, size: int) -> None:
            raise OSError(errno.EIO, os.strerror(errno.EIO))

    async def run() -> None:
        async with recording(tmp_path / "t.log") as (recorder, heard):
            monkeypatch.setattr(fs, "system", Full())
            recorder.offer(frame(0))
            await until(lambda: heard.failures)
            for _ in range(2):
                with pytest.raises(ProtocolError) as refused:
                    await recorder.reopen()
                assert refused.value.code == "storage_failed"
                assert recorder.failure is not None
            monkeypatch.setattr(fs, "system", fs.System())
            await recorder.reopen()
            recorder.offer(frame(0))
            await until(lambda: heard.acks == [1])

    asyncio.run(run())


def test_a_full_disk_is_one_line_of_the_log_however_many_batches_come(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class Full(fs.System):
        def write(self, fd: int, data: bytes | memoryview) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    async def run() -> None:
        async with recording(tmp_path / "t.log") as (recorder, heard):
            monkeypatch.setattr(fs, "system", Full())
            for n in range(5):
                recorder.offer(frame(0))
                await until(lambda: len(heard.failures) == n + 1)  # noqa: B023
                await recorder.reopen()  # as the tablet comes back: cutting a log needs no room
            monkeypatch.setattr(fs, "system", fs.System())
            recorder.offer(frame(0))
            await until(lambda: heard.acks == [1])

    asyncio.run(run())
    refused, recovered = (r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING)
    assert refused.startswith("the live log t.log cannot be written (disk_full)")
    assert recovered.startswith("writes succeed again")
    assert not any(r.exc_info for r in caplog.records)


def test_a_take_that_cannot_be_written_at_all_leaves_the_others_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def run() -> None:
        committer = Committer(0.02)
        committer.start()
        one, alternative = Heard(), Heard()
        first = await open_recorder(tmp_path / "1.log", HELLO, committer, one)
        second = await open_recorder(tmp_path / "2.log", HELLO, committer, alternative)

        def out_of_memory(_: bytes) -> None:
            raise MemoryError

        monkeypatch.setattr(first._lane.log, "append", out_of_memory)
        first.offer(frame(0))
        await until(lambda: one.failures)
        assert one.failures[0].code == "storage_failed"
        second.offer(frame(0))
        await until(lambda: alternative.acks == [1])
        await first.close()
        await second.close()
        committer.stop()

    asyncio.run(run())


def test_a_disk_that_cannot_begin_a_take_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def begin() -> str | None:
        try:
            recorder = await open_recorder(tmp_path / "live" / "t.log", HELLO, Committer(), Heard())
        except ProtocolError as refused:
            return f"{refused.code} {refused.close}"
        await recorder.close()
        return None

    failures = 0
    while True:
        monkeypatch.setattr(fs, "system", FailingSystem(failures + 1, errno.ENOSPC))
        refused = asyncio.run(begin())
        if refused is None:
            break
        assert refused == "storage_full 4507"
        failures += 1
    assert failures >= 5


def test_the_hash_of_a_long_take_is_over_all_its_starts(tmp_path: Path) -> None:
    frames = [frame(i) for i in range(9)]

    async def run() -> None:
        for start in (0, 3, 6):
            async with recording(tmp_path / "t.log") as (recorder, _):
                for one in frames[start : start + 3]:
                    recorder.offer(one)
        async with recording(tmp_path / "t.log") as (recorder, heard):
            recorder.offer(finish_text(frames))
            await until(lambda: heard.ends)
            assert heard.ends[0].problem is None
            assert heard.ends[0].sha256 == digest(frames)

    asyncio.run(run())
