"""Lasting breaks of a clock: jumps that explain themselves, a clock that was set back, a restart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.formats.clocks.report import Repair, describe_leap, describe_set_back
from sagittal.core.frames import Bools, Floats

_KNOWN: Final = (
    (512.0, 4, "one stamp of a 24-bit clock at 32768 Hz was counted once too often"),
    (1800.0, 28, "the clock was set, for example to summer time"),
    (86_400.0, 400, "days were counted wrongly"),
    (2.0**32 * 1e-6, 2, "a 32-bit clock of microseconds was counted once too often"),
)
"""Jumps in s, the most multiples of each, and their cause."""
_MIDNIGHT: Final = "a clock without a date starts again at midnight or noon"
_NEAR: Final = 0.5
"""A jump explains itself when it is so close to a known one, s; the rest may be samples that are missing."""
_BELIEVED: Final = 50
"""Rows of a stretch whose level is believed [chosen: 0.5 s at 100 Hz]."""
_EDGE: Final = 200
"""Rows next to a break over which the levels on both sides are taken."""
_AT_START: Final = 2.0
"""A clock that comes back to within so many s of its first stamp has started again."""


_SMALLEST_S: Final = 500.0
_LASTING_S: Final = 60.0
"""Both sides of a jump that lasts differ by it, but for what the rows there took, s."""
_FEW: Final = 20
"""Rows on both sides of a jump at least."""
_FAR_S: Final = 30.0
_FAR_ROWS: Final = 3000.0
"""A few stamps so far from the believed ones before and after are wrong, s or counts."""


@dataclass(frozen=True)
class Breaks:
    """Stamps without lasting breaks.

    Parameters
    ----------
    stamps : (n,) corrected. repairs : jumps removed. restart : row at which the clock starts again.
    """

    stamps: Floats
    repairs: tuple[Repair, ...]
    restart: int | None


def mend_breaks(x: Floats, step: float, usual: int, *, seconds: bool, wrap: float | None) -> Breaks:
    """Remove lasting jumps that are no loss of samples.

    Parameters
    ----------
    x : (n,) stamps in s, or counts of samples. step : of one row. usual : rows that share a stamp.
    wrap : of a narrow counter; a lasting jump back in it is a loss of more than half its range.
    """
    y, repairs = _remove_known(x, step) if seconds else (x.copy(), [])
    x = y.copy()
    level = x - step * np.arange(len(x))
    tolerance = step * max(3.0, 1.5 * usual)
    cut = np.flatnonzero(np.abs(np.diff(level)) > tolerance) + 1
    start, end = np.concatenate(([0], cut)), np.concatenate((cut, [len(x)]))
    long = end - start >= max(_BELIEVED, 2 * usual)
    pieces = list(zip(start[long].tolist(), end[long].tolist(), strict=True))
    if not pieces:
        return Breaks(y, (), None)
    y[_find_strays(level, pieces, _FAR_S if seconds else _FAR_ROWS)] = np.nan
    for (a, b), (c, d) in pairwise(pieces):
        jump = float(np.median(level[c : min(d, c + _EDGE)]) - np.median(level[max(a, b - _EDGE) : b]))
        # rows between two believed stretches belong to the later one where they are at its level
        row = c
        while row > b and abs(level[row - 1] - level[c]) <= tolerance:
            row -= 1
        if abs(jump) < tolerance:
            continue
        if not seconds:
            if jump < 0 and wrap is not None:
                y[row:] += wrap
            elif jump < 0:
                return Breaks(y, tuple(repairs), row)
            continue
        if (explanation := _explain(jump)) is not None:
            y[row:] -= explanation[0]
            repairs.append(describe_leap(row, explanation[0], explanation[1]))
        elif jump < 0:
            if x[c] < x[pieces[0][0]] + _AT_START:
                return Breaks(y, tuple(repairs), row)
            y[row:] -= jump
            repairs.append(describe_set_back(row, -jump))
    return Breaks(y, tuple(repairs), None)


def _remove_known(x: Floats, step: float) -> tuple[Floats, list[Repair]]:
    """Take back jumps from one row to the next that explain themselves and last."""
    y, repairs = x.copy(), []
    for i in np.flatnonzero(np.abs(np.diff(x) - step) > _SMALLEST_S) + 1:
        explanation = _explain(float(y[i] - y[i - 1] - step))
        if explanation is None:
            continue
        previous_values, next_values = y[max(0, i - _EDGE) : i], y[i : i + _EDGE]
        if len(next_values) < _FEW or len(previous_values) < _FEW:
            continue
        if abs(float(np.median(next_values) - np.median(previous_values)) - explanation[0]) < _LASTING_S:
            y[i:] -= explanation[0]
            repairs.append(describe_leap(int(i), explanation[0], explanation[1]))
    return y, repairs


def _find_strays(level: Floats, pieces: Sequence[tuple[int, int]], far: float) -> Bools:
    """Rows between believed stretches whose level is far from those on both sides."""
    strays = np.zeros(len(level), np.bool_)
    sides = [float(np.median(level[a:b][:_EDGE])) for a, b in pieces]
    ends = [float(np.median(level[a:b][-_EDGE:])) for a, b in pieces]
    starts = [0, *(b for _, b in pieces)]
    stops = [*(a for a, _ in pieces), len(level)]
    for i, (a, b) in enumerate(zip(starts, stops, strict=True)):
        around = [
            x for x in (ends[i - 1] if i else None, sides[i] if i < len(sides) else None) if x is not None
        ]
        strays[a:b] = (level[a:b] < min(around) - far) | (level[a:b] > max(around) + far)
    return strays


def _explain(jump: float) -> tuple[float, str] | None:
    for unit, most, reason in _KNOWN:
        times = round(jump / unit)
        if times and abs(times) <= most and abs(jump - times * unit) < _NEAR:
            return times * unit, _MIDNIGHT if times * unit in (-86_400.0, -43_200.0) else reason
    return None
