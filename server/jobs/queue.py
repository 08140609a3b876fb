"""Interface of the job queue, independent of its engine.

    queued → running → done | failed | cancelled          running → queued when its worker died or released it

The job's row is authoritative. A worker owns a job through its claim (job, attempt, worker), which fences
every write. A write that matches no row means that another worker owns the job: stop and publish nothing.
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
"""Jobs other than a visit's analysis; they do not affect the state shown on pages."""

JobState = Literal["queued", "running", "done", "failed", "cancelled"]


@dataclass(frozen=True)
class JobView:
    """A job as shown to users.

    Parameters
    ----------
    state : queued, running, done, failed or cancelled.
    attempt : attempts so far, excluding those that were released; 0 = none yet.
    stage, fraction, message : progress of the running attempt, None before its first report; fraction 0 to 1.
    cancel_requested : cancellation was requested; takes effect within two seconds.
    error_code, error_message : reason of the failure, otherwise None.
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
        """Whether the job has reached a final state."""
        return self.finished_at is not None


VIEW_COLUMNS = tuple(
    (job.c.attempt - job.c.released).label("attempt") if name == "attempt" else job.c[name]
    for name in JobView.__dataclass_fields__
)


def job_view(row: Row[Any]) -> JobView:
    """Build a view from a row of VIEW_COLUMNS (further columns are ignored)."""
    return JobView(**{name: getattr(row, name) for name in JobView.__dataclass_fields__})


@dataclass(frozen=True)
class Claim:
    """Ownership of one attempt by one worker, which fences its writes.

    Parameters
    ----------
    checkpoint : sha256 of an earlier attempt's checkpoint, None = start from the beginning.
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
    """Order in which jobs are claimed, smallest first."""

    IN_FRONT = -1
    """A user is waiting for it."""
    USUAL = 0
    BEHIND = 10
    """Long-running with checkpoints: yields to all other jobs."""


class LeaseState(Enum):
    """Result of a heartbeat: still owned, should yield, should be cancelled, or lost to another worker."""

    OURS = "ours"
    YIELD = "yield"
    """A low-priority job while another one is queued: release it; it resumes from its checkpoint."""
    CANCEL = "cancel"
    LOST = "lost"


class JobQueue(Protocol):
    """Operations required of a queue engine; False from a fenced write = the claim is lost."""

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
        """Queue a job in the caller's transaction, or return the pending or successful one with the
        same key.
        """

    def get(self, job_id: str) -> JobView | None:
        """Read one job."""

    def cancel(self, c: Connection, job_id: str) -> JobView | None:
        """Cancel a job: at once if queued, through its worker if running; no effect if finished."""

    def claim(self, worker: str, kinds: Collection[str]) -> Claim | None:
        """Claim the next job of these kinds, if any."""

    def heartbeat(self, claim: Claim) -> LeaseState:
        """Renew the lease."""

    def look(self, claim: Claim) -> LeaseState:
        """State of the lease, without renewing it."""

    def progress(self, claim: Claim, stage: str, fraction: float, message: str | None = None) -> bool:
        """Report the progress of an attempt."""

    def keep(self, claim: Claim, sha256: str, require: Publish) -> str | None:
        """Register a checkpoint that `require` confirms as stored, and reset the count of crashes.

        Returns
        -------
        The checkpoint that became unreferenced: the previous one, `sha256` itself if the claim is lost,
        or None.
        """

    def finish(self, claim: Claim, publish: Publish) -> bool:
        """Publish and mark done in one transaction; refused also after a cancel request."""

    def fail(self, claim: Claim, code: str, message: str) -> bool:
        """Mark the job failed with a reason."""

    def stop(self, claim: Claim) -> bool:
        """Confirm a requested cancellation."""

    def note_death(self, claim: Claim) -> bool:
        """Record that the worker crashed; the job is retried, and fails at the third crash."""

    def release(self, claim: Claim) -> bool:
        """Return the job to the queue: the worker shuts down, or its files are temporarily unavailable.

        The attempt is not counted.
        """

    def listen(self) -> AbstractContextManager[Wait]:
        """Context in which an idle worker can wait for claimable jobs."""
