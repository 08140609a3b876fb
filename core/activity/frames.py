"""Features at ten frames per second of a body-worn sensor, and a preallocated store for one day of them.

Equations: docs/science/activity.md, "Reduction".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.events.turns import Turn
from sagittal.core.frames import Bools, Floats

Singles = NDArray[np.float32]

FRAME_HZ: Final = 10
"""Frames a second: the low-passed signals have nothing above 1 Hz."""
PER_MINUTE: Final = 60 * FRAME_HZ
"""Frames of a minute."""


@dataclass(frozen=True, eq=False)
class Frames:
    """Features of f frames at ten per second, in single precision: one day is held in memory at a time.

    Parameters
    ----------
    first : index of the first frame since the recording's first sample. valid : (f,) no sample is missing.
    gravity : (f, 3) low-passed specific force, m/s², sensor axes. up : (f,) acceleration along it, mean of
        the frame, m/s². spread : (f,) mean square of |acc| about its mean over 1 s, (m/s²)².
    sd, wobble : (f / 600, 3) per minute: standard deviation of the samples and of their means over 1 s, m/s²;
        NaN if less than half of the minute was measured.
    """

    first: int
    valid: Bools
    gravity: Singles
    up: Singles
    spread: Singles
    sd: Singles
    wobble: Singles


@dataclass(frozen=True, eq=False)
class Slab:
    """Frames of one slab with the steps and turns in it (s since the recording's first sample)."""

    frames: Frames
    steps_s: tuple[float, ...]
    turns: tuple[Turn, ...]


class FrameStore:
    """Preallocated arrays for the frames of one day and its margins, reused day after day.

    Allocating and freeing the pieces of each day would fragment the memory of the process.
    """

    def __init__(self, room: int) -> None:
        """Reserve room for a number of frames, a whole number of minutes; memory pages are touched only
        when filled.
        """
        minutes = room // PER_MINUTE
        self._kept = Frames(
            0,
            np.empty(room, np.bool_),
            np.empty((room, 3), np.float32),
            np.empty(room, np.float32),
            np.empty(room, np.float32),
            np.empty((minutes, 3), np.float32),
            np.empty((minutes, 3), np.float32),
        )
        self._first = self._count = 0

    @property
    def end(self) -> int:
        """Index of the next frame."""
        return self._first + self._count

    def append(self, more: Frames) -> None:
        """Append consecutive frames; only the last ones of a recording may end within a minute."""
        end = self._count + len(more.valid)
        for stored, new in zip(_list_columns(self._kept, self._count, end), _list_columns(more), strict=True):
            stored[:] = new[: len(stored)]
        self._count = end

    def view(self, end: int) -> Frames:
        """Stored frames up to `end`; valid until the next `drop_before`."""
        stored, n = self._kept, min(end, self.end) - self._first
        minutes = -(-n // PER_MINUTE)
        return Frames(
            self._first,
            stored.valid[:n],
            stored.gravity[:n],
            stored.up[:n],
            stored.spread[:n],
            stored.sd[:minutes],
            stored.wobble[:minutes],
        )

    def drop_before(self, first: int) -> None:
        """Discard the frames before the first frame of a minute."""
        cut = min(self._count, max(0, first - self._first))
        left = self._count - cut
        whole = -(-left // PER_MINUTE) * PER_MINUTE
        to, source = _list_columns(self._kept, 0, left), _list_columns(self._kept, cut, cut + whole)
        for target, moved in zip(to, source, strict=True):
            target[:] = moved[: len(target)]
        self._first, self._count = self._first + cut, left


def _list_columns(frames: Frames, first: int = 0, end: int | None = None) -> list[NDArray[Any]]:
    """Columns of the frames from the first frame of a minute to `end`, in storage order."""
    minutes = slice(first // PER_MINUTE, None if end is None else -(-end // PER_MINUTE))
    part = slice(first, end)
    return [
        *(x[part] for x in (frames.valid, frames.gravity, frames.up, frames.spread)),
        *(x[minutes] for x in (frames.sd, frames.wobble)),
    ]


def measure_length(x: Singles) -> Floats:
    """Length (n,) of vectors (n, 3), in double precision without copying them."""
    return np.asarray(np.sqrt(np.einsum("ni,ni->n", x, x, dtype=np.float64)))
