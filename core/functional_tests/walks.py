"""Ten-metre and six-minute walk tests from the strides of the feet (docs/science/timed-tests.md).

The distance covered by a foot increases by the length of each of its strides, linearly within a stride; the
distance of the person is the mean of both feet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Final

import numpy as np

from sagittal.core.events.bouts import Bout
from sagittal.core.events.result import Strides
from sagittal.core.frames import SIDES, Floats
from sagittal.core.functional_tests.result import FunctionalTest, TimedSegment, state_figures
from sagittal.core.parameters.catalogue import list_names
from sagittal.core.parameters.catalogue.entry import WALK_TESTS
from sagittal.core.parameters.measure import MeasuredGait
from sagittal.core.parameters.rows import Column
from sagittal.core.signals.recording import GivenLimits

TEN: Final = tuple(n for n in list_names(WALK_TESTS, "take") if n.startswith("walk_10m_"))
SIX: Final = tuple(n for n in list_names(WALK_TESTS, "take") if n.startswith("walk_6min_"))

LENGTH: Final = "stride_length_m"


@dataclass(frozen=True)
class WalkTestParams:
    """Parameters of both walk tests.

    Parameters
    ----------
    cut_m : acceleration and deceleration distance at either end of the ten-metre walk. least_m : shortest
        timed distance. seconds, minute_s : duration of the six-minute walk and of its parts. short_s :
        tolerance for a shorter six-minute walk.
    """

    cut_m: float = 2.0
    least_m: float = 3.0
    seconds: float = 360.0
    minute_s: float = 60.0
    short_s: float = 10.0


@dataclass(frozen=True, eq=False)
class WalkedWay:
    """Distance (m,) in m at times (m,) in s, both increasing, with linear interpolation."""

    t_s: Floats
    way_m: Floats

    def at(self, t_s: float) -> float:
        """Distance at a time, m."""
        return float(np.interp(t_s, self.t_s, self.way_m))

    def when(self, way_m: float) -> float:
        """First time at which a distance is reached, s."""
        return float(np.interp(way_m, self.way_m, self.t_s))


def follow_way(
    strides: Strides, lengths: Sequence[float | None], start_s: float, end_s: float
) -> WalkedWay | None:
    """Distance of the feet over a time range; None if a foot has no stride with a known length.

    A stride of unknown length is assigned the median of its foot: the person continued walking.
    """
    grid = np.union1d(np.arange(start_s, end_s, 0.1), [end_s])
    ways = []
    for side in SIDES:
        rows = [
            (s.start_s, s.end_s, nan if length is None else length)
            for s, length in zip(strides.strides, lengths, strict=True)
            if s.side == side and s.end_s > start_s and s.start_s < end_s and s.end_s - s.start_s < 3.0
        ]
        table = np.array(rows, np.float64).reshape(-1, 3)
        lengths_known = table[np.isfinite(table[:, 2]), 2]
        if len(lengths_known) < 3:
            continue
        table[np.isnan(table[:, 2]), 2] = np.median(lengths_known)
        way = np.zeros(len(grid))
        for a, b, length in table:
            way += length * np.clip((grid - a) / (b - a), 0.0, 1.0)
        ways.append(way - way[0])
    if not ways:
        return None
    return WalkedWay(grid, np.mean(ways, axis=0))


def measure_ten_metres(
    measured: MeasuredGait, limits: GivenLimits | None = None, params: WalkTestParams | None = None
) -> FunctionalTest:
    """Speed over the middle of the longest walk without a turn.

    Returns
    -------
    FunctionalTest; no values and the reason "no_bouts" without walking, "no_foot_track" without stride
    lengths, "walk_too_short" if too little distance remains between the ends.
    """
    params, limits = params or WalkTestParams(), limits or GivenLimits()
    corrected = limits.start_s is not None or limits.end_s is not None
    span = _longest_straight(measured, limits)
    if span is None:
        return FunctionalTest(None, None, (), state_figures({}, TEN, "no_bouts"), None, corrected)
    way = follow_way(measured.strides, _lengths(measured), *span)
    if way is None:
        return FunctionalTest(*span, (), state_figures({}, TEN, "no_foot_track"), None, corrected)
    total = float(way.way_m[-1])
    timed = total - 2.0 * params.cut_m
    if timed < params.least_m:
        return FunctionalTest(*span, (), state_figures({}, TEN, "walk_too_short"), None, corrected)
    timed = min(timed, 10.0)
    begin = way.when(0.5 * (total - timed))
    end = way.when(0.5 * (total + timed))
    values: dict[str, float | None] = {
        "walk_10m_speed_mps": timed / (end - begin),
        "walk_10m_distance_m": timed,
        "walk_10m_time_s": end - begin,
    }
    parts = (("speeding_up", span[0], begin), ("timed_metres", begin, end), ("slowing_down", end, span[1]))
    segments = tuple(TimedSegment(*part) for part in parts)
    return FunctionalTest(*span, segments, state_figures(values, TEN, None), None, corrected)


def measure_six_minutes(
    measured: MeasuredGait, limits: GivenLimits | None = None, params: WalkTestParams | None = None
) -> FunctionalTest:
    """Distance, rests and slowing over six minutes from the first step on.

    Returns
    -------
    FunctionalTest; no values and the reason "no_bouts" without walking, "walk_too_short" if the recording
    ends too early; distances have "no_foot_track" without stride lengths.
    """
    params, limits = params or WalkTestParams(), limits or GivenLimits()
    corrected = limits.start_s is not None or limits.end_s is not None
    if not measured.bouts:
        return FunctionalTest(None, None, (), state_figures({}, SIX, "no_bouts"), None, corrected)
    start = measured.bouts[0].start_s if limits.start_s is None else limits.start_s
    last = measured.bouts[-1].end_s
    end = min(start + params.seconds, last) if limits.end_s is None else limits.end_s
    if end - start < params.seconds - params.short_s and limits.end_s is None:
        return FunctionalTest(start, end, (), state_figures({}, SIX, "walk_too_short"), None, corrected)
    walking = [(max(b.start_s, start), min(b.end_s, end)) for b in measured.bouts]
    walking = [(a, b) for a, b in walking if b > a]
    stopped = sum(b - a for bout in measured.bouts for a, b in _within(bout, start, end))
    values: dict[str, float | None] = {
        "walk_6min_standing_s": end - start - sum(b - a for a, b in walking) + stopped
    }
    way = follow_way(measured.strides, _lengths(measured), start, end)
    if way is not None:
        first = way.at(start + params.minute_s) / params.minute_s
        final = (float(way.way_m[-1]) - way.at(end - params.minute_s)) / params.minute_s
        values |= {
            "walk_6min_distance_m": float(way.way_m[-1]),
            "walk_6min_first_mps": first,
            "walk_6min_last_mps": final,
            "walk_6min_slowing_pct": 100.0 * (1.0 - final / first) if first > 0.0 else None,
        }
    minutes = np.arange(start, end - 1.0, params.minute_s)
    segments = tuple(
        TimedSegment(f"minute_{i + 1}", float(a), float(min(a + params.minute_s, end)))
        for i, a in enumerate(minutes)
    )
    rows = state_figures(values, SIX, "no_foot_track")
    return FunctionalTest(start, end, segments, rows, None, corrected)


def _lengths(measured: MeasuredGait) -> Column:
    return measured.columns.get(LENGTH, (None,) * len(measured.strides.strides))


def _longest_straight(measured: MeasuredGait, limits: GivenLimits) -> tuple[float, float] | None:
    """The longest walk without a turn, within the manually given limits."""
    low = -np.inf if limits.start_s is None else limits.start_s
    high = np.inf if limits.end_s is None else limits.end_s
    spans = []
    for bout in measured.bouts:
        marks = [(t.start_s, t.end_s) for t in measured.turns if bout.start_s < t.start_s < bout.end_s]
        starts = [bout.start_s, *(b for _, b in marks)]
        ends = [*(a for a, _ in marks), bout.end_s]
        spans += [(max(a, low), min(b, high)) for a, b in zip(starts, ends, strict=True)]
    best = max(spans, key=lambda s: s[1] - s[0], default=None)
    return None if best is None or best[1] <= best[0] else best


def _within(bout: Bout, start: float, end: float) -> list[tuple[float, float]]:
    """Stops of a bout within the test."""
    cut = [(max(a, start), min(b, end)) for a, b in bout.stops]
    return [(a, b) for a, b in cut if b > a]
