"""What a job may say while it runs, and what it goes on from after an attempt that did not end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol


class Say(Protocol):
    """Tell which stage begins and what share of the job is done, perhaps with a sentence."""

    def __call__(self, stage: str, share: float, message: str | None = None, /) -> None:
        """Say it; the newest word within half a second is heard."""


@dataclass(frozen=True)
class Attempt:
    """What a run may say, and what it goes on from.

    Parameters
    ----------
    keep : leaves bytes from which another attempt can go on, should this one end before its time. A job that
        leaves some may run as long as it likes, and makes way for more urgent ones.
    checkpoint : what an earlier attempt left, None = nothing.
    """

    progress: Say
    keep: Callable[[bytes], None]
    checkpoint: bytes | None = None
