"""The port every part of the server sees of the jobs, whatever engine stands behind it.

    queued → running → done | failed | cancelled          running → queued when its worker died or let go

The job's row is the truth. A worker owns a job through its claim (job, attempt, worker): every write carries
it as a fence. A write that meets no row means that the job has gone to somebody else: stop, publish nothing.
"""

from __future__ import annotations

import datetime as dt
import threading
from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Any, Final, Literal, Protocol

from sqlalchemy import Connection, Row

from sagittal.server.storage.schema.tables import job

Publish = Callable[[Connection], None]
"""Writes a result's rows; called inside the transaction that marks the job done."""
Wait = Callable[[threading.Event], object]
"""Returns when there may be a job to claim, or soon after the event is set."""


TUNE: Final = "tune"
COMPARE_FILTERS: Final = "compare_filters"
SENSITIVITY: Final = "sensitivity"
EXPORT: Final = "export"
BESIDE: Final = (TUNE, COMPARE_FILTERS, SENSITIVITY, EXPORT)
"""Kinds of jobs beside a visit's analysis: it stays what pages show, whatever becomes of them."""

JobState = Literal["queued", "running", "done", "failed", "cancelled"]


@dataclass(frozen=True)
class JobView:
    """A piece of work for a worker, as people may see it.

    Parameters
    ----------
    state : queued, running, done, failed or cancelled.
    attempt : attempts so far, without those that were given back unharmed; 0 = none yet.
    stage, fraction, message : progress of the running attempt, None before its first word; fraction 0 to 1.
    cancel_requested : somebody asked to stop it; it will within two seconds.
    error_code, error_message : why it failed, else None.
    """

    id: str
    kind: str
    recording_id: str | None
    state: JobState
    attempt: int
    stage: str | None
    fraction: float | None
    message: str | None
    cancel_requested: bool
    error_code: str | None
    error_message: str | None
    created_at: dt.datetime
    started_at: dt.datetime | None
    finished_at: dt.datetime | None

    @property
    def finished(self) -> bool:
        """Nothing will change any more."""
        return self.finished_at is not None


VIEW_COLUMNS = tuple(
    (job.c.attempt - job.c.released).label("attempt") if name == "attempt" else job.c[name]
    for name in JobView.__dataclass_fields__
)


def job_view(row: Row[Any]) -> JobView:
    """Read a view from a row of VIEW_COLUMNS (further columns are ignored)."""
    return JobView(**{name: getattr(row, name) for name in JobView.__dataclass_fields__})


@dataclass(frozen=True)
class Claim:
    """The right of one worker to one attempt; what it may write is fenced by it.

    Parameters
    ----------
    checkpoint : sha256 of what an earlier attempt kept, None = from the start.
    """

    job_id: str
    attempt: int
    worker: str
    kind: str
    recording_id: str | None
    requested_by: str | None
    params: Mapping[str, Any]
    checkpoint: str | None = None


class Priority(IntEnum):
    """Which job is claimed first; the smaller."""

    IN_FRONT = -1
    """Somebody waits in front of the screen."""
    USUAL = 0
    BEHIND = 10
    """Runs for long and leaves checkpoints: it makes way for every other job."""


class LeaseState(Enum):
    """What a heartbeat found: the job is still ours, makes way, is to be stopped, or is somebody else's."""

    OURS = "ours"
    YIELD = "yield"
    """This job is behind and another one waits: give it back, it goes on from its checkpoint."""
    CANCEL = "cancel"
    LOST = "lost"


class JobQueue(Protocol):
    """What the server needs of any queue engine; False from a fenced write = the claim is lost."""

    def submit(
        self,
        c: Connection,
        *,
        key: str,
        kind: str,
        params: Mapping[str, Any],
        recording_id: str | None = None,
        requested_by: str | None = None,
        priority: Priority = Priority.USUAL,
    ) -> JobView:
        """Queue a job in the caller's transaction, or return the live or successful one of the same key."""

    def get(self, job_id: str) -> JobView | None:
        """Read one job."""

    def cancel(self, c: Connection, job_id: str) -> JobView | None:
        """Stop a job: at once if queued, through its worker if running; a finished one stays as it is."""

    def claim(self, worker: str, kinds: Collection[str]) -> Claim | None:
        """Take the next job of these kinds, if there is one."""

    def heartbeat(self, claim: Claim) -> LeaseState:
        """Renew the lease."""

    def look(self, claim: Claim) -> LeaseState:
        """Ask whether the job is still ours, without renewing anything."""

    def progress(self, claim: Claim, stage: str, fraction: float, message: str | None = None) -> bool:
        """Say how far the attempt is."""

    def keep(self, claim: Claim, sha256: str, require: Publish) -> str | None:
        """Keep a checkpoint that `require` finds stored, and forgive deaths until now.

        Returns
        -------
        The checkpoint that no longer refers to anything: the earlier one, `sha256` itself when the claim is
        lost, None when there is none.
        """

    def finish(self, claim: Claim, publish: Publish) -> bool:
        """Publish and mark done in one transaction; refused also after a request to cancel."""

    def fail(self, claim: Claim, code: str, message: str) -> bool:
        """End the job with a reason."""

    def stop(self, claim: Claim) -> bool:
        """Confirm a requested cancel."""

    def note_death(self, claim: Claim) -> bool:
        """Report that the attempt ended without a word: run again, the third time give up."""

    def release(self, claim: Claim) -> bool:
        """Give the job back unharmed: the worker shuts down, or its files cannot be reached now.

        It does not count as an attempt of the job.
        """

    def listen(self) -> AbstractContextManager[Wait]:
        """While the block runs, an idle worker can wait for a job that may be claimed."""
