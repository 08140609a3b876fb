"""Progress reports of a running job, and checkpoints from which a later attempt resumes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol


class Say(Protocol):
    """Reports the current stage, the completed fraction of the job and optionally a message."""

    def __call__(self, stage: str, share: float, message: str | None = None, /) -> None:
        """Report progress; only the latest report within half a second is sent."""


@dataclass(frozen=True)
class Attempt:
    """Interface of one attempt of a job: progress reports and checkpoints.

    Parameters
    ----------
    keep : stores a checkpoint from which another attempt can resume. A job with checkpoints has no total time
        limit, and yields to more urgent jobs.
    checkpoint : checkpoint of an earlier attempt, None = start from the beginning.
    """

    progress: Say
    keep: Callable[[bytes], None]
    checkpoint: bytes | None = None
