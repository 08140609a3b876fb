"""Runs of rows in their true order → a time for every row, and where samples are missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.formats.clocks.step import Ints
from sagittal.core.frames import Bools, Floats

_FLOOR_ROWS: Final = 300
"""Rows ahead among which one at least was stamped without delay [chosen: 3 s at 100 Hz]."""
_SMOOTH_ROWS: Final = 1000
"""Rows over which the delays of packets are averaged."""
_LOST: Final = 0.6
"""Of a step: a lasting delay above it is a lost sample."""
_LOST_JITTER: Final = 1.5
"""The same where the ends of packets move by a row."""
_EXACT: Final = 0.1
"""Of a step: packets whose stamps are so close to whole samples have no jitter."""
_LATE: Final = 1.5
"""Of a step: a delay that ends again and exceeds it is one of transmission."""
_NEIGHBOURS: Final = 5


@dataclass(frozen=True)
class RowTimes:
    """Times of rows.

    Parameters
    ----------
    ticks : (n,) strictly increasing. extra : (n,) rows that no time is left for. late : (n,) stamped after a
        delay. shared : (n,) rows that repeat the stamp of the row before. step : of one row, measured again.
    """

    ticks: Floats
    extra: Bools
    late: Bools
    shared: Bools
    step: float


def spread_rows(stamps: Floats, widths: Ints, wrong: Bools, step: float, usual: int) -> RowTimes:
    """Give every row a time.

    Parameters
    ----------
    stamps : (m,) of runs in their true order; those of `wrong` (m,) runs are ignored. widths : (m,) rows of
        each run. step : of one row. usual : rows of a usual run.
    """
    rows = int(widths.sum())
    first = np.concatenate(([0], np.cumsum(widths)[:-1]))
    knots = np.flatnonzero(~wrong)
    extra = np.zeros(rows, np.bool_)
    shared = np.zeros(rows, np.bool_)
    if usual == 1 and (widths[knots] > 1).any():
        extra = _find_extra(stamps, widths, first, knots, step, rows)
        new_index = np.cumsum(~extra) - 1
        first = new_index[first]
        repeats = np.ones(rows, np.bool_)
        repeats[np.concatenate(([0], np.cumsum(widths)[:-1]))] = False
        shared = repeats & ~extra
    total = rows - int(extra.sum())
    if usual > 1 and len(knots) > 2 and knots[0] == 0 and widths[0] < usual:
        knots = knots[1:]  # a run that was cut off at the start: nobody knows of how many rows
    place, stamp = first[knots], stamps[knots]
    delay = stamp / step - place
    delay = delay - delay[0]
    floor = _find_floor(delay, max(4, _FLOOR_ROWS // usual))
    jump = np.diff(floor, prepend=floor[0])
    off = np.abs(np.diff(delay) - np.round(np.diff(delay)))
    jitter = usual > 1 and len(off) > 0 and float(np.median(off)) > _EXACT
    lost = np.where(jump > (_LOST_JITTER if jitter else _LOST), np.round(jump), 0.0)
    slots = np.arange(total, dtype=np.float64)
    gained = np.zeros(total)
    np.add.at(gained, place, lost)
    slots += np.cumsum(gained)
    late = np.zeros(rows, np.bool_)
    lag = delay - floor
    kept_knots = lag > -_LOST if usual == 1 else np.ones(len(knots), np.bool_)
    if usual == 1 and (lag > _LATE).any():
        kept_knots &= lag <= _LOST
        row_of = np.flatnonzero(~extra)
        late[row_of[place[~kept_knots]]] = True
    x, y = slots[place[kept_knots]], stamp[kept_knots]
    if usual > 1:
        step, y = _smooth(x, y, step, usual)
    ticks = np.interp(slots, x, y)
    ticks[slots < x[0]] = y[0] + (slots[slots < x[0]] - x[0]) * step
    ticks[slots > x[-1]] = y[-1] + (slots[slots > x[-1]] - x[-1]) * step
    out = np.full(rows, np.nan)
    out[~extra] = ticks
    return RowTimes(out, extra, late, shared, step)


def _find_floor(delay: Floats, ahead: int) -> Floats:
    """Running minimum of the delay over the next `ahead` runs, for each run."""
    from scipy.ndimage import median_filter, minimum_filter1d  # not in the web server

    size = min(ahead, len(delay))
    delay = median_filter(delay, min(_NEIGHBOURS, len(delay)), mode="nearest")
    return np.asarray(minimum_filter1d(delay, size, origin=-(size // 2), mode="nearest"))


def _find_extra(stamps: Floats, widths: Ints, first: Ints, knots: Ints, step: float, rows: int) -> Bools:
    """Rows that repeat a stamp and for which the clock does not catch up: there is no time for them."""
    extra = np.zeros(rows, np.bool_)
    delay = stamps[knots] / step - first[knots]
    for k in np.flatnonzero(widths[knots] > 1):
        previous_delays = delay[max(0, k + 1 - _NEIGHBOURS) : k + 1]
        next_delays = delay[k + 1 : k + 1 + _NEIGHBOURS]
        if not len(next_delays):
            continue
        more = round(float(np.median(previous_delays) - np.median(next_delays)) - 0.15)
        if more > 0:
            run = knots[k]
            start, end = first[run], first[run] + widths[run]
            extra[max(start + 1, end - more) : end] = True
    return extra


def _smooth(x: Floats, y: Floats, step: float, usual: int) -> tuple[float, Floats]:
    """The step measured again, and stamps of packets without their jitter."""
    from scipy.ndimage import uniform_filter1d  # not in the web server

    if len(x) < 4:
        return step, y
    scaled = np.polyfit(x - x[0], y - y[0], 1)
    left = y - y[0] - np.polyval(scaled, x - x[0])
    near = np.abs(left - np.median(left)) <= 4.0 * np.median(np.abs(left - np.median(left))) + 1e-9 * step
    if near.sum() >= 4:
        scaled = np.polyfit(x[near] - x[0], y[near] - y[0], 1)
    step = float(scaled[0])
    left = y - y[0] - step * (x - x[0])
    size = min(len(x), max(5, _SMOOTH_ROWS // usual))
    return step, y[0] + step * (x - x[0]) + uniform_filter1d(left, size, mode="nearest")
