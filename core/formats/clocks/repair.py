"""Stamps or counts of a column → true times of its rows (docs/science/timeline.md, "Clocks").

Order of work: rows without a stamp; wraps; duplicate rows; lasting breaks; rows out of order and wrong
stamps; stamps shared by several rows. A column without any of these is returned unchanged, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.formats.clocks import report
from sagittal.core.formats.clocks.breaks import mend_breaks
from sagittal.core.formats.clocks.order import SortedRuns, sort_runs
from sagittal.core.formats.clocks.report import Repair
from sagittal.core.formats.clocks.spread import RowTimes, spread_rows
from sagittal.core.formats.clocks.step import BURST, LARGE, Ints, Packets, find_packets, is_bursty
from sagittal.core.formats.clocks.wraps import find_wrap, unwrap
from sagittal.core.frames import Bools, Floats

_LONG_GAP_S: Final = 30.0
"""A longer step may be a clock that was set."""
_LEAST_SPAN_S: Final = 1e-6
"""Stamps that span less are no clock."""
_FEW_STAMPS: Final = 4e-4
"""Share of different stamps below which a column is no clock."""
_NARROW: Final = 4096.0
"""Counts of a counter whose range may be shorter than a loss."""


@dataclass(frozen=True)
class RepairedClock:
    """True times of the rows of a file.

    Parameters
    ----------
    rows : (k,) retained rows of the file, in their true order; None = all rows in file order.
    ticks : (k,) strictly increasing, in the unit given.
    step : of one row in that unit, None = the clock was not repaired, or the step is unknown.
    repairs : faults found and their correction. restart : row at which a second recording begins.
    constant : number of different stamps where nearly all are equal.
    """

    rows: Ints | None
    ticks: Floats
    step: float | None = None
    repairs: tuple[Repair, ...] = ()
    restart: int | None = None
    constant: int | None = None


def repair_clock(
    ticks: Floats, signals: Sequence[Floats], *, seconds: bool, wrap: float | None = None, tick: float = 0.0
) -> RepairedClock:
    """Find the true time of every row.

    Parameters
    ----------
    ticks : (n,) stamps in s or counts of samples, NaN where missing. signals : (n, c) of the same rows, by
        which duplicates are recognised. seconds : what `ticks` are. wrap : known range of the clock, in the
        unit of `ticks`. tick : smallest unit of the column as written, in that unit; 0 = unknown.
    """
    has_stamp = np.isfinite(ticks)
    if seconds and has_stamp.sum() > 1 and np.ptp(ticks[has_stamp]) < _LEAST_SPAN_S:
        return RepairedClock(
            np.flatnonzero(has_stamp), ticks[has_stamp], constant=len(np.unique(ticks[has_stamp]))
        )
    if has_stamp.all() and wrap is None and _is_clean(ticks, seconds=seconds):
        return RepairedClock(None, ticks)
    table = np.concatenate(signals, axis=1)
    has_data = has_stamp | np.isfinite(table).any(axis=1)
    rows = np.flatnonzero(has_data)
    if not has_stamp.any():
        return RepairedClock(rows[:0], ticks[:0])
    x = _fill(ticks[rows])
    repairs: list[Repair] = []
    if (lost := np.flatnonzero(~has_stamp[rows])).size:
        repairs.append(report.describe_missing(len(lost), int(rows[lost[0]])))
    if wrap is not None:
        x = unwrap(x, wrap)
        if has_stamp.all() and _is_clean(x, seconds=seconds):
            blind = _find_blind(x, wrap, seconds=seconds)
            return RepairedClock(None, x, repairs=blind)
    runs = find_packets(x)
    distinct = len(np.unique(x))
    if runs.step is None or (distinct < max(3.0, _FEW_STAMPS * len(x)) and len(x) > 20):
        return RepairedClock(rows, x, constant=distinct)
    if (lead := int(np.argmax(has_stamp[rows]))) > 0:
        x[:lead] = x[lead] - runs.step * np.arange(lead, 0, -1)
        runs = find_packets(x)
    step = runs.step or 1.0
    if wrap is None and (wrap_match := find_wrap(x, step, runs.usual, tick, seconds=seconds)) is not None:
        repairs.append(_describe_wrap(x, rows, *wrap_match))
        x = unwrap(x, wrap_match[0])
        runs = find_packets(x)
    found_rows = _Rows(x, rows, _hash_rows(table[rows]), ~has_stamp[rows])
    return _repair(found_rows, runs, repairs, seconds=seconds, wrap=wrap)


@dataclass(frozen=True)
class _Rows:
    """Rows of a file: stamps, place in the file, a number of the signals, whether the stamp was filled in."""

    x: Floats
    at: Ints
    same: Floats
    filled: Bools

    def without(self, drop: Bools) -> _Rows:
        """All rows but some."""
        return _Rows(self.x[~drop], self.at[~drop], self.same[~drop], self.filled[~drop])


def _repair(
    rows: _Rows, runs: Packets, repairs: list[Repair], *, seconds: bool, wrap: float | None
) -> RepairedClock:
    """Breaks, order and sharing of stamps whose wraps are undone."""
    rows, runs = _drop_twice(rows, runs, np.zeros(len(rows.x), np.bool_), repairs)
    step = runs.step or 1.0
    narrow = wrap if wrap is not None and wrap <= _NARROW and not seconds else None
    broken = mend_breaks(rows.x, step, runs.usual, seconds=seconds, wrap=narrow)
    if broken.restart is not None:
        return RepairedClock(rows.at, rows.x, step, restart=int(rows.at[broken.restart]))
    repairs += broken.repairs
    written = rows.x
    strange = np.isnan(broken.stamps)
    if broken.repairs or strange.any():
        x = _join_equal(_fill(broken.stamps), 8.0 * float(np.spacing(np.abs(written).max())))
        rows = replace(rows, x=x, filled=rows.filled | strange)
        row_count = len(rows.x)
        rows, runs = _drop_twice(rows, find_packets(x), strange, repairs)
        if len(rows.x) < row_count:
            strange, written = np.zeros(len(rows.x), np.bool_), rows.x
        step = runs.step or step
    x, widths = rows.x, runs.widths(len(rows.x))
    ordered = sort_runs(runs.stamps, widths, step, np.add.reduceat(rows.same, runs.first))
    row_index = _rows_of(runs.first, widths, ordered.order)
    ignored = ordered.wrong
    if runs.usual > 1:  # the first rows of a run after rows without a stamp may be among these
        ignored = ignored | (rows.filled[runs.first - 1] & (runs.first > 0))[ordered.order]
    spread = spread_rows(runs.stamps[ordered.order], widths[ordered.order], ignored, step, runs.usual)
    repairs += _describe_order(ordered, runs, widths, rows.at)
    wrong = np.repeat(ordered.wrong, widths[ordered.order]) | strange[row_index]
    sorted_rows = replace(
        rows, x=np.where(strange, written, x)[row_index], at=rows.at[row_index], filled=rows.filled[row_index]
    )
    repairs += _describe_spread(sorted_rows, spread, wrong, runs, seconds=seconds)
    keep = ~spread.extra
    blind = _find_blind(spread.ticks[keep], wrap, seconds=seconds) if wrap is not None else ()
    return RepairedClock(sorted_rows.at[keep], spread.ticks[keep], spread.step, (*repairs, *blind))


def _drop_twice(rows: _Rows, runs: Packets, but: Bools, repairs: list[Repair]) -> tuple[_Rows, Packets]:
    """Rows without those that were stored twice."""
    twice = _find_twice(rows.x, rows.same, runs) & ~but
    if not twice.any():
        return rows, runs
    repairs.append(report.describe_repeats(int(twice.sum()), int(rows.at[twice][0])))
    rows = rows.without(twice)
    return rows, find_packets(rows.x)


def _is_clean(x: Floats, *, seconds: bool) -> bool:
    """Whether stamps rise one by one, without bursts and without a step that may be a clock that was set."""
    d = np.diff(x)
    if not len(d):
        return True
    if not (d > 0).all():
        return False
    if not seconds:
        return True
    usual = float(np.median(d))
    longest = float(d.max())
    if longest >= _LONG_GAP_S or d.min() <= BURST * usual:
        return False
    return longest <= LARGE * usual or not is_bursty(x)


def _fill(x: Floats) -> Floats:
    """Missing stamps repeat the one before; the first ones the first that is known."""
    finite = np.isfinite(x)
    if finite.all():
        return x
    last = np.maximum.accumulate(np.where(finite, np.arange(len(x)), -1))
    return x[np.where(last < 0, int(np.argmax(finite)), last)]


def _join_equal(x: Floats, rounding: float) -> Floats:
    """Stamps that only rounding makes differ from the one before are made equal to it."""
    apart = np.concatenate(([True], np.abs(np.diff(x)) > rounding))
    return x if apart.all() else x[np.maximum.accumulate(np.where(apart, np.arange(len(x)), 0))]


def _hash_rows(signals: Floats) -> Floats:
    """A number per row that differs where the signals do."""
    weights = np.sqrt(np.arange(2, signals.shape[1] + 2, dtype=np.float64))
    return np.where(np.isfinite(signals), signals, -1e3) @ weights


def _find_twice(x: Floats, same: Floats, runs: Packets) -> Bools:
    """Rows that repeat an earlier one: stamp and signals are equal."""
    twice = np.zeros(len(x), np.bool_)
    if runs.usual == 1:
        order = np.lexsort((same, x))
        equal = (np.diff(x[order]) == 0) & (np.diff(same[order]) == 0)
        twice[order[1:][equal]] = True
        return twice
    widths = runs.widths(len(x))
    for k in np.flatnonzero((widths % 2 == 0) & (widths > 1.5 * runs.usual)):
        a, half = int(runs.first[k]), int(widths[k]) // 2
        if (same[a : a + half] == same[a + half : a + 2 * half]).all():
            twice[a + half : a + 2 * half] = True
    return twice


def _rows_of(first: Ints, widths: Ints, order: Ints) -> Ints:
    """Rows of runs in a given order."""
    width = widths[order]
    start = np.repeat(first[order] - np.concatenate(([0], np.cumsum(width)[:-1])), width)
    return start + np.arange(int(width.sum()))


def _describe_wrap(x: Floats, rows: Ints, wrap: float, label: str) -> Repair:
    drops = np.flatnonzero(np.diff(x) < -0.6 * wrap)
    return report.describe_wrap(len(drops), int(rows[drops[0] + 1]), label)


def _find_blind(x: Floats, wrap: float, *, seconds: bool) -> tuple[Repair, ...]:
    """Losses in a counter whose range is shorter than a loss may be."""
    if seconds or wrap > _NARROW:
        return ()
    holes = np.flatnonzero(np.diff(x) > 0.1 * wrap)
    return (report.describe_blind(len(holes), int(holes[0]) + 1, wrap),) if len(holes) else ()


def _describe_order(ordered: SortedRuns, runs: Packets, widths: Ints, rows: Ints) -> list[Repair]:
    out = []
    for run_indices, describe in (
        (ordered.moved, report.describe_order),
        (ordered.repeated, report.describe_repeats),
        (ordered.unplaced, report.describe_dropped),
    ):
        if len(run_indices):
            out.append(describe(int(widths[run_indices].sum()), int(rows[runs.first[run_indices.min()]])))
    return out


def _describe_spread(
    rows: _Rows, spread: RowTimes, wrong: Bools, runs: Packets, *, seconds: bool
) -> list[Repair]:
    """Repairs of rows (n,) in their true order."""
    out = []
    wrong = wrong & ~spread.extra
    if wrong.any():
        off = np.nanmax(np.abs(rows.x[wrong] - spread.ticks[wrong]))
        out.append(report.describe_wrong(int(wrong.sum()), int(rows.at[wrong].min()), float(off)))
    if spread.extra.any():
        first = int(rows.at[spread.extra].min())
        out.append(report.describe_no_time_left(int(spread.extra.sum()), first))
    if spread.late.any():
        out.append(report.describe_late(int(spread.late.sum()), int(rows.at[spread.late].min())))
    if runs.usual > 1:
        most = int(np.quantile(runs.widths(len(rows.x)), 0.99, method="higher"))
        out.append(report.describe_shared(most, 1.0 / spread.step if seconds else None))
    elif (shared := spread.shared & ~rows.filled).any():
        out.append(report.describe_equal_neighbours(int(shared.sum()), int(rows.at[shared].min())))
    return out
