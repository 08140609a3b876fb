"""Whose word a worker takes for whose: a child whose job was left in its midst is never asked again."""

from __future__ import annotations

import errno
import inspect
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import pytest

from sagittal.server.jobs.queue import Claim, JobQueue, LeaseState
from sagittal.server.processes.channel import Channel
from sagittal.server.settings import Settings
from sagittal.server.storage import references
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import Blob, BlobStore, StoreAway
from sagittal.server.worker import worker as at
from sagittal.server.worker.child import compute
from sagittal.server.worker.messages import Checkpoint, ChildReady, Failure, Order, Result
from sagittal.server.worker.task import TASKS, Task

SPACE = "0" * 32


def claim(number: int) -> Claim:
    fields: dict[str, Any] = dict.fromkeys(inspect.signature(Claim).parameters)
    fields |= {"job_id": f"job-{number}", "attempt": 1, "kind": "told", "params": {"space": SPACE}}
    return Claim(**fields)


class ToldChild:
    """Write a checkpoint, and return the first job's result on the second attempt."""

    pid = 1

    def __init__(self, settings: Settings) -> None:
        self.said: list[object] = [ChildReady()]
        self.asked = 0

    def send(self, order: object) -> None:
        self.asked += 1
        self.said.append(Checkpoint(b"half") if self.asked == 1 else Result({"whose": b"the first"}))

    def receive(self, patience_s: float) -> object:
        return self.said.pop(0) if self.said else None

    def kill(self) -> None:
        self.said.clear()


class ToldQueue:
    """Two jobs and their published results."""

    def __init__(self, stop: threading.Event, leave: Callable[[], None]) -> None:
        self.stop, self.leave, self.number = stop, leave, 0
        self.published: list[tuple[str, Mapping[str, bytes]]] = []

    @contextmanager
    def listen(self) -> Iterator[Callable[[threading.Event], None]]:
        yield lambda stop: stop.set()

    def claim(self, *remainder: object) -> Claim | None:
        self.number += 1
        if self.number <= 2:
            return claim(self.number)
        self.stop.set()
        return None

    def look(self, this: Claim) -> LeaseState:
        if self.number == 1:
            self.leave()
        if self.number == 2:
            self.stop.set()
        return LeaseState.OURS

    heartbeat = look

    def keep(self, *remainder: object) -> str:
        return "f" * 64

    def finish(self, this: Claim, publish: partial[None]) -> bool:
        self.published.append((this.job_id, publish.keywords["files"]))
        return True

    def release(self, this: Claim) -> bool:
        return True


def work(monkeypatch: pytest.MonkeyPatch, leave: Callable[[], None]) -> ToldQueue:
    stop = threading.Event()
    queue = ToldQueue(stop, leave)
    monkeypatch.setattr(at, "Child", ToldChild)
    monkeypatch.setattr(at, "LOOK_S", 0.0)
    monkeypatch.setitem(TASKS, "told", cast("Any", SimpleNamespace(keeps_files=True, publish=None)))
    db = cast("Database", SimpleNamespace(do_alone=lambda name: contextmanager(lambda: iter([False]))()))
    blobs = cast("BlobStore", SimpleNamespace(put=lambda space, content: Blob("a" * 64, 1)))
    settings = cast("Settings", SimpleNamespace(lease_s=15.0, job_timeout_s=100.0))
    at.Worker(settings, db, blobs, cast("JobQueue", queue), stop).run()
    return queue


def test_a_job_that_was_left_in_its_midst_is_not_answered_for_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def leave() -> None:
        raise StoreAway("away", refuses=False)

    monkeypatch.setattr(references, "discard", lambda *_: None)
    assert work(monkeypatch, leave).published == []


def test_a_former_checkpoint_that_cannot_be_removed_stops_no_job(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def discard(*remainder: object) -> None:
        tried.append("discard")
        raise StoreAway("away", refuses=False)

    def leave() -> None:
        if tried:
            tried.append("looked again")
            raise StoreAway("away", refuses=False)

    monkeypatch.setattr(references, "discard", discard)
    work(monkeypatch, leave)
    assert tried[:2] == ["discard", "looked again"]


def test_a_full_disk_is_no_error_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*remainder: object) -> dict[str, bytes]:
        raise OSError(errno.ENOSPC, "No space left on device", "walk.c3d")

    monkeypatch.setitem(TASKS, "told", Task("told", run, lambda *rest: None, keeps_files=False))
    result = compute(Order("told", None, [], {}), cast("BlobStore", None), cast("Channel", None))
    assert isinstance(result, Failure)
    assert (result.code, result.passing) == ("disk_full", False)
    assert "disk is full" in result.message
