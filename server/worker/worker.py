"""A worker: claims jobs, has its child compute them, keeps the lease alive, publishes.

It runs in a process of its own (`sagittal serve` starts one, `sagittal worker` is one); run as a module it
ends with its starter. Numbers are computed in the child only: that one may be killed at any moment.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Mapping

from sqlalchemy import Connection
from sqlalchemy.exc import SQLAlchemyError

from core.errors import SagittalError
from server.jobs.opening import open_queue
from server.jobs.queue import Claim, JobQueue, LeaseState, Wait
from server.log import start_log
from server.processes.lifeline import call_when_parent_ends
from server.services import custody, erasure
from server.services.sweep import sweep
from server.settings import Settings, load_settings
from server.storage.blobs import Blob, BlobStore
from server.storage.db import Database
from server.storage.migrate import require_current
from server.storage.tables import new_id
from server.worker.messages import Checkpoint, ChildReady, Failure, Input, Order, Result, Stage
from server.worker.runner import Child, ChildDiedError
from server.worker.task import TASKS, Task, load

log = logging.getLogger("server.worker.worker")

IDLE_S = 0.2
"""Longest wait for a word of the child, and first pause after an error."""
LOOK_S = 0.5
"""Pause between two looks for a request to cancel, and between two progress writes (at most 2 per second)."""
CHECKPOINT_S = 5.0
"""Least pause between two checkpoints that are stored."""
SWEEP_S = 3600.0
"""Pause between two sweeps for files that nothing refers to."""
WARM_LIMIT_S = 300.0
"""A child that is not ready by then will not be."""


class Worker:
    """One worker with one child.

    Parameters
    ----------
    stop : set it to end: the current job is given back unharmed.
    """

    def __init__(
        self, settings: Settings, db: Database, blobs: BlobStore, queue: JobQueue, stop: threading.Event
    ) -> None:
        self._settings, self._db, self._blobs, self._queue = settings, db, blobs, queue
        self._stop = stop
        self._name = f"{socket.gethostname()[:40]}:{os.getpid()}:{new_id()[:8]}"
        self._child: Child | None = None

    def run(self) -> None:
        """Work until stopped; an error of the database or the child costs a pause, never the worker."""
        try:
            with self._queue.listen() as wait:
                self._work(wait)
        finally:
            self._drop_child()

    def _work(self, wait: Wait) -> None:
        pause_s = IDLE_S
        next_sweep = 0.0
        while not self._stop.is_set():
            try:
                if time.monotonic() >= next_sweep:
                    next_sweep = time.monotonic() + SWEEP_S
                    sweep(self._db, self._blobs, self._settings)
                worked = self._turn()
                pause_s = IDLE_S
                if not worked:
                    wait(self._stop)
            except (ChildDiedError, SQLAlchemyError, OSError):
                log.exception("worker %s: will try again", self._name)
                self._drop_child()
                pause_s = min(2 * pause_s, 30.0)
                self._stop.wait(pause_s)

    def _turn(self) -> bool:
        child = self._warm_child()
        if child is None:
            return True
        claim = self._queue.claim(self._name, tuple(TASKS))
        if claim is None:
            return False
        self._attend(claim, child)
        return True

    def _warm_child(self) -> Child | None:
        """The ready child, or None when we were stopped while it got ready."""
        if self._child is not None:
            self._child.receive(0.0)  # raises if it died while idle
            return self._child
        self._child = child = Child(self._settings)
        limit = time.monotonic() + WARM_LIMIT_S
        while not self._stop.is_set():
            if isinstance(child.receive(IDLE_S), ChildReady):
                return child
            if time.monotonic() > limit:
                raise ChildDiedError(f"computing process {child.pid} was not ready after {WARM_LIMIT_S:g} s")
        return None

    def _attend(self, claim: Claim, child: Child) -> None:
        """See one attempt to its end, whichever it is."""
        log.info("job %s (%s), attempt %d", claim.job_id, claim.kind, claim.attempt)
        try:
            child.send(_order(claim))
            end = self._listen(claim, child)
        except ChildDiedError as error:
            log.warning("job %s: %s", claim.job_id, error)
            self._child = None
            self._queue.note_death(claim)
            return
        match end:
            case Result(files):
                self._publish(claim, files)
            case Failure(code, message):
                self._fail(claim, code, message)
            case LeaseState.CANCEL:
                self._drop_child()
                self._queue.stop(claim)
            case LeaseState.LOST:
                log.warning("job %s: the lease is lost, its result is not used", claim.job_id)
                self._drop_child()
            case LeaseState.OURS | LeaseState.YIELD:
                self._drop_child()
                self._queue.release(claim)

    def _listen(self, claim: Claim, child: Child) -> Result | Failure | LeaseState:
        """Keep the lease, pass on progress until the child is done or must end (OURS: we are stopped).

        The time limit counts from the last checkpoint: whoever leaves one is not stuck.
        """
        beat_s = self._settings.lease_s / 3
        began = time.monotonic()
        next_beat, next_look = began + beat_s, began + LOOK_S
        next_keep = began
        stage: Stage | None = None
        heard = False
        checkpoint: Checkpoint | None = None
        while not self._stop.is_set():
            reply = child.receive(min(IDLE_S, beat_s / 2))
            if isinstance(reply, Result | Failure):
                return reply
            if isinstance(reply, Stage):
                if not heard:  # the first word is passed on at once: a short job has no second
                    heard, next_look = True, began
                stage = reply
            if isinstance(reply, Checkpoint):
                checkpoint = reply
            time_now = time.monotonic()
            if checkpoint is not None and time_now >= next_keep:
                self._keep(claim, checkpoint.content)
                checkpoint, began, next_keep = None, time_now, time_now + CHECKPOINT_S
            if time_now - began > self._settings.job_timeout_s:
                self._drop_child()
                return Failure(
                    "job_timeout",
                    f"The job ran longer than {self._settings.job_timeout_s:g} s and was stopped. "
                    "Analyse a shorter part of the recording.",
                )
            if time_now >= next_look or time_now >= next_beat:
                due = time_now >= next_beat
                hold = self._queue.heartbeat(claim) if due else self._queue.look(claim)
                if hold is not LeaseState.OURS:
                    return hold
                if due:
                    next_beat = time_now + beat_s
                if stage is not None and not self._queue.progress(
                    claim, stage.name, stage.fraction, stage.message
                ):
                    return LeaseState.LOST
                stage, next_look = None, time_now + LOOK_S
        return LeaseState.OURS

    def _keep(self, claim: Claim, content: bytes) -> None:
        """Store a checkpoint, then remove the one before it; the job goes on without where that fails."""
        space = str(claim.params["space"])
        try:
            blob = self._blobs.put(space, content)
            idle = self._queue.keep(claim, blob.sha256, lambda _: self._blobs.require(space, blob.sha256))
        except (OSError, SagittalError):
            log.exception("job %s: a checkpoint could not be stored", claim.job_id)
            return
        if idle is not None:
            erasure.discard(self._db, self._blobs, space, [idle])

    def _publish(self, claim: Claim, files: Mapping[str, bytes]) -> None:
        """Files first, then one transaction under the fence."""
        task = TASKS[claim.kind]
        try:
            blobs = self._store(task, claim, files)
            done = self._queue.finish(claim, lambda c: self._write(c, task, claim, files, blobs))
        except SagittalError as error:
            self._fail(claim, error.code, error.message)
        except OSError as error:
            log.exception("job %s: the result could not be stored", claim.job_id)
            self._fail(
                claim,
                "not_stored",
                f"The result could not be stored ({error.strerror}). Make room, run again.",
            )
        else:
            if not done:
                self._put_away(claim, blobs)

    def _put_away(self, claim: Claim, blobs: Mapping[str, Blob]) -> None:
        """Deal with a result that nobody wants any more."""
        if self._queue.look(claim) is LeaseState.CANCEL:
            self._queue.stop(claim)
        elif blobs and self._queue.get(claim.job_id) is None:
            # erased while it was computed: nothing of it may wait in the trash
            names = [blob.sha256 for blob in blobs.values()]
            erasure.discard(self._db, self._blobs, str(claim.params["space"]), names)

    def _store(self, task: Task, claim: Claim, files: Mapping[str, bytes]) -> dict[str, Blob]:
        if not task.keeps_files:
            return {}
        self._queue.heartbeat(claim)
        space = str(claim.params["space"])
        return {name: self._blobs.put(space, content) for name, content in files.items()}

    def _write(
        self,
        c: Connection,
        task: Task,
        claim: Claim,
        files: Mapping[str, bytes],
        blobs: Mapping[str, Blob],
    ) -> None:
        for blob in blobs.values():
            self._blobs.require(str(claim.params["space"]), blob.sha256)
        task.publish(c, claim, files, blobs)

    def _fail(self, claim: Claim, code: str, message: str) -> None:
        if self._queue.look(claim) is LeaseState.CANCEL:
            self._queue.stop(claim)
        else:
            self._queue.fail(claim, code, message)

    def _drop_child(self) -> None:
        if self._child is not None:
            self._child.kill()
            self._child = None


def _order(claim: Claim) -> Order:
    params = dict(claim.params)
    files = [Input(f["name"], f["size"], f["sha256"]) for f in params.pop("files", ())]
    return Order(claim.kind, params.get("space"), files, params, claim.checkpoint)


def run_worker(settings: Settings, *, with_starter: bool = False) -> None:
    """Be a worker until SIGTERM or SIGINT, or until the starter is gone; the job at hand is given back."""
    require_current(settings.database_source)
    load(settings.task_modules)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    if with_starter:
        call_when_parent_ends(stop.set)
    db = Database(settings.database_source)
    try:
        custody.refuse_foreign_folder(db, settings, stop)
        queue = open_queue(db, settings.lease_s)
        Worker(settings, db, BlobStore(settings.blobs), queue, stop).run()
    finally:
        db.close()


if __name__ == "__main__":
    own_settings = load_settings()
    start_log(own_settings)
    run_worker(own_settings, with_starter=True)
