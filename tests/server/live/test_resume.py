"""Protocol and resume as a machine: tablet, dying server and full disk against a small model."""

from __future__ import annotations

import asyncio
import errno
import json
import os
import shutil
import stat
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from sagittal.server.live.committer import Committer
from sagittal.server.live.intake import IntakeAnswer, TakeEnd
from sagittal.server.live.protocol import MOST_UNACKED, CloseCode, ProtocolError
from sagittal.server.live.recorder import Recorder, restore
from sagittal.server.storage import fs
from tests.helpers.live_takes import HELLO, digest, finish_text, frame, stored

LENGTH = 12
FRAMES = [frame(i, n=2) for i in range(LENGTH)]


class Disk(fs.System):
    """The disk of one log: how much of it a power cut leaves, and calls that fail half done."""

    def __init__(self) -> None:
        self.sure = 0
        self.fails_in: int | None = None
        self._number = 0

    def fail(self, calls: int | None, number: int = 0) -> None:
        self.fails_in, self._number = calls, number

    def write(self, fd: int, data: bytes | memoryview) -> int:
        try:
            self._count()
        except OSError:
            super().write(fd, data[: len(data) // 2])
            raise
        return super().write(fd, data)

    def fsync(self, fd: int) -> None:
        self._count()  # and no real sync: nobody cuts the power of this machine
        fstat = os.fstat(fd)
        if stat.S_ISREG(fstat.st_mode):
            self.sure = fstat.st_size

    def _count(self) -> None:
        if self.fails_in is not None:
            self.fails_in -= 1
            if self.fails_in <= 0:
                raise OSError(self._number, os.strerror(self._number))


class Tablet:
    """Model of a tablet: it keeps every batch until it is acknowledged."""

    def __init__(self) -> None:
        self.at = 0  # the batch it sends next
        self.reached = 0  # batches ever sent
        self.acked = 0  # batches the server has promised to keep
        self.online = False
        self.end: TakeEnd | None = None

    def welcomed(self, next_seq: int) -> None:
        assert self.acked <= next_seq <= self.reached, "the server lost what it had acknowledged"
        self.at, self.online = next_seq, True
        self.acked = next_seq

    def heard(self, limit: int) -> None:
        assert limit <= self.reached
        self.acked = max(self.acked, limit)

    def lost(self) -> None:
        self.online = False


class Stream(RuleBasedStateMachine):
    """Every way a take can go; the committer's thread is stepped by hand."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.path = self.folder / "live" / "t.log"
        self.tablet = Tablet()
        self.recorder: Recorder | None = None
        self.disk = Disk()
        fs.system = self.disk

    def teardown(self) -> None:
        fs.system = fs.System()
        self.die()
        shutil.rmtree(self.folder)

    # what the recorder tells

    def note_growth(self, size: int) -> None:
        assert self.path.stat().st_size == size

    def note_acknowledged(self, below: int) -> None:
        self.tablet.heard(below)

    def note_end(self, end: TakeEnd) -> None:
        self.tablet.end = end

    def note_failure(self, error: ProtocolError) -> None:
        assert error.close is CloseCode.STORAGE
        self.tablet.lost()

    # what happens

    @initialize()
    def begin(self) -> None:
        self.connect()

    @precondition(lambda self: not self.tablet.online)
    @rule()
    def connect(self) -> None:
        if self.recorder is None:
            self.committer = Committer()
            self.recorder = Recorder(*restore(self.path, HELLO), self.committer, self, lambda f, x: f(x))
        elif self.recorder.failure:
            asyncio.run(self.recorder.reopen())
        self.tablet.welcomed(self.said(self.recorder.greet(HELLO))["next_seq"])

    @precondition(lambda self: self.tablet.online and self.tablet.at < LENGTH)
    @rule(number=st.integers(1, 5))
    def send(self, number: int) -> None:
        for one in FRAMES[self.tablet.at : self.tablet.at + number]:
            reference = self.tablet.at < self.recorder_.next_seq  # sent again after a drop: a duplicate
            answer = self.offer(one)
            assert answer.close is (CloseCode.ENDED if self.over and not reference else None)
            if answer.close is None:
                self.tablet.at += 1
                self.tablet.reached = max(self.tablet.reached, self.tablet.at)

    @precondition(lambda self: self.tablet.online and self.tablet.at > 0)
    @rule(data=st.data())
    def duplicate(self, data: st.DataObject) -> None:
        answer = self.offer(FRAMES[data.draw(st.integers(0, self.tablet.at - 1))])
        assert self.said(answer) == {"type": "ack", "ack": self.recorder_.durable}
        assert answer.close is None

    @precondition(lambda self: self.tablet.online and self.recorder_.next_seq < LENGTH - 1)
    @rule(data=st.data())
    def skip(self, data: st.DataObject) -> None:
        answer = self.offer(FRAMES[data.draw(st.integers(self.recorder_.next_seq + 1, LENGTH - 1))])
        assert answer.close is (CloseCode.ENDED if self.over else CloseCode.GAP)

    @precondition(lambda self: self.tablet.online and self.tablet.at < LENGTH)
    @rule(at=st.integers(0, len(FRAMES[0]) - 1), bit=st.integers(0, 7))
    def corrupt(self, at: int, bit: int) -> None:
        whole = bytearray(FRAMES[self.tablet.at])
        whole[at % len(whole)] ^= 1 << bit
        assert self.offer(bytes(whole)).close is CloseCode.MALFORMED

    @precondition(lambda self: self.tablet.online)
    @rule()
    def finish(self) -> None:
        answer = self.offer(finish_text(FRAMES))
        assert answer.close is None
        if self.recorder_.next_seq < LENGTH:
            assert self.said(answer)["next_seq"] == self.recorder_.next_seq
        elif answer.ended:
            assert self.tablet.end in (None, answer.ended)  # None: the server died before it could say so
            self.tablet.end = answer.ended

    @rule()
    def write(self) -> None:
        self.step(self.committer.write)

    @rule()
    def sync(self) -> None:
        self.step(self.committer.write, self.committer.sync)

    @precondition(lambda self: self.recorder is not None and not self.recorder.failure)
    @rule(call=st.integers(1, 2), number=st.sampled_from([errno.ENOSPC, errno.EIO]))
    def refuse(self, call: int, number: int) -> None:
        self.disk.fail(call, number)
        self.step(self.committer.write, self.committer.sync)
        self.disk.fail(None)

    @rule()
    def drop(self) -> None:
        self.tablet.lost()

    @rule()
    def kill(self) -> None:
        self.die()

    @rule(share=st.floats(0.0, 1.0), zeros=st.integers(0, 40))
    def power_cut(self, share: float, zeros: int) -> None:
        self.die()
        whole = self.path.read_bytes()
        left = self.disk.sure + round(share * (len(whole) - self.disk.sure))
        self.path.write_bytes(whole[:left] + bytes(min(zeros, len(whole) - left)))

    # what always holds

    @invariant()
    def the_log_is_a_prefix_of_what_was_sent_and_holds_what_was_acknowledged(self) -> None:
        if not self.path.exists():
            return
        retained = stored(self.path)
        assert retained == FRAMES[: len(retained)]
        assert self.tablet.acked <= len(retained) <= self.tablet.reached
        end = self.tablet.end
        if end is not None:
            assert (end.count, end.sha256, end.problem) == (LENGTH, digest(FRAMES), None)
            assert retained == FRAMES

    # in words of the rules above

    @property
    def over(self) -> bool:
        return self.recorder_._intake.is_over

    @property
    def recorder_(self) -> Recorder:
        assert self.recorder is not None
        return self.recorder

    def offer(self, message: bytes | str) -> IntakeAnswer:
        answer = self.recorder_.offer(message)
        if answer.close is not None:
            assert self.said(answer)["type"] == "error"
            self.tablet.lost()
        return answer

    def step(self, *steps: Any) -> None:
        if self.recorder is not None:
            for one in steps:
                one()

    def said(self, answer: IntakeAnswer) -> dict[str, Any]:
        assert answer.say is not None
        return dict(json.loads(answer.say))

    def die(self) -> None:
        if self.recorder is not None:
            self.recorder._lane.log.close()
        self.recorder = None
        self.tablet.lost()


Stream.TestCase.settings = settings(max_examples=100, stateful_step_count=40, deadline=None)
TestStream = pytest.mark.slow(Stream.TestCase)


def test_the_model_fits_the_limits_of_the_protocol() -> None:
    assert LENGTH < MOST_UNACKED
