"""Worker: claims jobs, lets its child compute them, renews the lease and publishes the results.

It runs in its own process (started by `sagittal serve` or as `sagittal worker`); run as a module it ends with
its parent. Computations run only in the child, which may be killed at any moment.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from functools import partial
from typing import ParamSpec, TypeVar

from sqlalchemy import Connection
from sqlalchemy.exc import SQLAlchemyError

from sagittal.core.errors import SagittalError
from sagittal.server.jobs.opening import open_queue
from sagittal.server.jobs.queue import Claim, JobQueue, LeaseState, Wait
from sagittal.server.log import start_log
from sagittal.server.processes.lifeline import call_when_parent_ends
from sagittal.server.safekeeping import custody
from sagittal.server.safekeeping.sweep import sweep
from sagittal.server.settings import Settings, load_settings
from sagittal.server.storage import fs, references
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_opening import open_blobs, require_use
from sagittal.server.storage.files.blobs import Blob, BlobStore, StoreAway
from sagittal.server.storage.migrate import await_current, require_current
from sagittal.server.storage.refusal import is_busy
from sagittal.server.storage.schema.tables import new_id
from sagittal.server.worker.messages import Checkpoint, ChildReady, Failure, Input, Order, Result, Stage
from sagittal.server.worker.runner import Child, ChildDiedError
from sagittal.server.worker.task import TASKS, Task, load

log = logging.getLogger("sagittal.server.worker.worker")
P = ParamSpec("P")
T = TypeVar("T")

IDLE_S = 0.2
"""Maximum wait for a message of the child, and first pause after an error."""
LOOK_S = 0.5
"""Interval of checks for a cancel request, and of progress writes (at most 2 per second)."""
CHECKPOINT_S = 5.0
"""Minimum interval of stored checkpoints."""
SWEEP_S = 3600.0
"""Interval of sweeps for unreferenced files."""
LONGEST_PAUSE_S = 5.0
"""Maximum pause between retries of a write while the database is busy."""
WARM_LIMIT_S = 300.0
"""Time limit for a child to become ready."""


class Worker:
    """One worker with one child.

    Parameters
    ----------
    stop : set to end; the current job is released.
    """

    def __init__(
        self, settings: Settings, db: Database, blobs: BlobStore, queue: JobQueue, stop: threading.Event
    ) -> None:
        self._settings, self._db, self._blobs, self._queue = settings, db, blobs, queue
        self._stop = stop
        self._name = f"{socket.gethostname()[:40]}:{os.getpid()}:{new_id()[:8]}"
        self._child: Child | None = None

    def run(self) -> None:
        """Work until stopped; after an error of the database or the child it pauses and continues."""
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
                    with self._db.do_alone("sweep") as is_mine:
                        if is_mine:
                            sweep(self._db, self._blobs, self._settings)
                worked = self._turn()
                pause_s = IDLE_S
                if not worked:
                    wait(self._stop)
            except StoreAway as error:
                log.warning("worker %s: the stored files cannot be reached (%s)", self._name, error.detail)
                pause_s = self._rest(pause_s)
            except (ChildDiedError, SQLAlchemyError, OSError):
                log.exception("worker %s: will try again", self._name)
                self._drop_child()
                pause_s = self._rest(pause_s)

    def _rest(self, pause_s: float) -> float:
        """Wait twice as long as the last time."""
        longer_s = min(2 * pause_s, 30.0)
        self._stop.wait(longer_s)
        return longer_s

    def _turn(self) -> bool:
        child = self._warm_child()
        if child is None:
            return True
        claim = self._persist(self._queue.claim, self._name, tuple(TASKS))
        if claim is None:
            return False
        self._attend(claim, child)
        return True

    def _warm_child(self) -> Child | None:
        """The ready child, or None if stopped while it was starting."""
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
        """Run one attempt to its end, whatever the outcome."""
        log.info("job %s (%s), claim %d", claim.job_id, claim.kind, claim.attempt)
        try:
            child.send(_order(claim))
            end = self._listen(claim, child)
        except ChildDiedError as error:
            log.warning("job %s: %s", claim.job_id, error)
            self._child = None
            self._persist(self._queue.note_death, claim)
            return
        except BaseException:
            # it continues computing, and its next message would be taken for that of the next job
            self._drop_child()
            raise
        match end:
            case Result(files):
                self._publish(claim, files)
            case Failure(passing=True):
                self._wait_for_store(claim)
            case Failure(code, message):
                self._fail(claim, code, message)
            case LeaseState.CANCEL:
                self._drop_child()
                self._persist(self._queue.stop, claim)
            case LeaseState.LOST:
                log.warning("job %s: the lease is lost, its result is not used", claim.job_id)
                self._drop_child()
            case LeaseState.OURS | LeaseState.YIELD:
                self._drop_child()
                self._persist(self._queue.release, claim)

    def _listen(self, claim: Claim, child: Child) -> Result | Failure | LeaseState:
        """Renew the lease and forward progress until the child is done or must end (OURS: stopping).

        The time limit counts from the last checkpoint, as a job that stores checkpoints is not stuck.
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
                if not heard:  # the first report is forwarded immediately: a short job has no second
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
                hold = self._persist(self._queue.heartbeat if due else self._queue.look, claim)
                if hold is not LeaseState.OURS:
                    return hold
                if due:
                    next_beat = time_now + beat_s
                if stage is not None and not self._persist(
                    self._queue.progress, claim, stage.name, stage.fraction, stage.message
                ):
                    return LeaseState.LOST
                stage, next_look = None, time_now + LOOK_S
        return LeaseState.OURS

    def _persist(self, ask: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call the queue; while the database is busy or unavailable, log and retry.

        The child continues meanwhile. If the job was given to another worker, the fence detects it
        afterwards.

        Raises
        ------
        SQLAlchemyError
            another error, or the worker is stopped while waiting.
        """
        began, pause_s = time.monotonic(), IDLE_S
        while True:
            try:
                return ask(*args, **kwargs)
            except SQLAlchemyError as error:
                if not is_busy(error) or self._stop.is_set():
                    raise
                log.warning(
                    "worker %s: the database has been busy or away for %.0f s; trying again (%s)",
                    self._name, time.monotonic() - began, " ".join(str(error.args[0]).split()),
                )  # fmt: skip
            self._stop.wait(pause_s)
            pause_s = min(2 * pause_s, LONGEST_PAUSE_S)

    def _keep(self, claim: Claim, content: bytes) -> None:
        """Store a checkpoint, then remove the previous one; failures are logged and the job continues."""
        space = str(claim.params["space"])
        try:
            blob = self._holding(claim, lambda: self._blobs.put(space, content))
            idle = self._persist(
                self._queue.keep, claim, blob.sha256, lambda _: self._blobs.require(space, blob.sha256)
            )
        except (OSError, SagittalError):
            log.exception("job %s: a checkpoint could not be stored", claim.job_id)
            return
        if idle is None:
            return
        try:
            references.discard(self._db, self._blobs, space, [idle])
        except (OSError, SagittalError, SQLAlchemyError):
            log.exception("job %s: a former checkpoint stays for the sweep", claim.job_id)

    def _publish(self, claim: Claim, files: Mapping[str, bytes]) -> None:
        """Store the files first, then commit one transaction under the fence."""
        task = TASKS[claim.kind]
        try:
            blobs = self._store(task, claim, files)
            publish = partial(self._write, task=task, claim=claim, files=files, blobs=blobs)
            done = self._persist(self._queue.finish, claim, publish)
        except StoreAway:
            self._wait_for_store(claim)
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

    def _wait_for_store(self, claim: Claim) -> None:
        """Release a job whose files could not be read or stored, and pause; the attempt is not counted."""
        if self._persist(self._queue.look, claim) is LeaseState.CANCEL:
            self._persist(self._queue.stop, claim)
        else:
            self._persist(self._queue.release, claim)
        raise StoreAway(f"job {claim.job_id} waits", refuses=False)

    def _put_away(self, claim: Claim, blobs: Mapping[str, Blob]) -> None:
        """Dispose of a result that is no longer wanted."""
        if self._persist(self._queue.look, claim) is LeaseState.CANCEL:
            self._persist(self._queue.stop, claim)
        elif blobs and self._queue.get(claim.job_id) is None:
            # erased in the meantime: nothing of it may remain in the trash
            names = [blob.sha256 for blob in blobs.values()]
            references.discard(self._db, self._blobs, str(claim.params["space"]), names)

    def _store(self, task: Task, claim: Claim, files: Mapping[str, bytes]) -> dict[str, Blob]:
        if not task.keeps_files:
            return {}
        self._persist(self._queue.heartbeat, claim)
        space = str(claim.params["space"])
        return self._holding(
            claim, lambda: {name: self._blobs.put(space, content) for name, content in files.items()}
        )

    def _holding(self, claim: Claim, work: Callable[[], T]) -> T:
        """Run a long operation while renewing the lease."""
        with ThreadPoolExecutor(1) as pool:
            doing = pool.submit(work)
            while not wait_for([doing], self._settings.lease_s / 3).done:
                self._persist(self._queue.heartbeat, claim)
            return doing.result()

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
        if self._persist(self._queue.look, claim) is LeaseState.CANCEL:
            self._persist(self._queue.stop, claim)
        else:
            self._persist(self._queue.fail, claim, code, message)

    def _drop_child(self) -> None:
        if self._child is not None:
            self._child.kill()
            self._child = None


def _order(claim: Claim) -> Order:
    params = dict(claim.params)
    files = [Input(f["name"], f["size"], f["sha256"]) for f in params.pop("files", ())]
    return Order(claim.kind, params.get("space"), files, params, claim.checkpoint)


def run_worker(settings: Settings, *, with_starter: bool = False) -> None:
    """Run a worker until SIGTERM or SIGINT, or until the parent ends; the current job is released.

    Waits until a server has prepared the database.
    """
    load(settings.task_modules)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    if with_starter:
        call_when_parent_ends(stop.set)
    await_current(settings.database_source, stop)
    if stop.is_set():
        return
    db = Database(settings.database_source)
    try:
        custody.refuse_foreign_folder(db, settings, stop)
        fs.make_folder(settings.data_dir)
        holder = f"worker process {os.getpid()} on {socket.gethostname()}"
        with fs.Lock(settings.workers_lock, holder, shared=True):
            # until now files and database could be moved elsewhere
            require_current(settings.database_source)
            blobs = open_blobs(settings)
            require_use(blobs)
            queue = open_queue(db, settings.lease_s)
            Worker(settings, db, blobs, queue, stop).run()
    finally:
        db.close()


if __name__ == "__main__":
    own_settings = load_settings()
    start_log(own_settings)
    run_worker(own_settings, with_starter=True)
