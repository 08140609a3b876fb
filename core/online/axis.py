"""Batches of several device clocks → ONE uniform axis, sample by sample, as core/timeline.py lays out a file."""

from __future__ import annotations

from dataclasses import dataclass

from core.frames import Bools, Floats


@dataclass(frozen=True, eq=False)
class UniformBlock:
    """The next samples of the axis.

    Parameters
    ----------
    first : index of the first one on the axis; blocks follow each other without a hole.
    t_s : (T,) seconds from the first sample of the axis, as `UniformRecording.t_s`.
    acc, gyr : (T, n, 3) m/s², rad/s of the n worn sensors in the order of `OnlineAxis.segments`; finite
        everywhere, invalid samples hold the last value (0 before the first).
    valid : (T, n) measured or interpolated over ≤ 0.1 s. interpolated : (T, n) filled.
    """

    first: int
    t_s: Floats
    acc: Floats
    gyr: Floats
    valid: Bools
    interpolated: Bools

    def __len__(self) -> int:
        return len(self.t_s)
