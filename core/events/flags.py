"""Flags of a gait cycle from its neighbours, and exclusion by flags.

A flag is an observation and is kept; the reason for exclusion is a decision derived from it. Gait initiation,
termination and turns are not steady walking, however short the walk; only strides next to a turn are counted
if hardly any others are left.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Final, get_args

import numpy as np

from sagittal.core.events.result import Stride, StrideFlag

ORDER: Final[tuple[StrideFlag, ...]] = get_args(StrideFlag)

_BROKEN: Final = frozenset[StrideFlag]({"gap", "incomplete", "implausible_time"})

YIELDING: Final[StrideFlag] = "near_turn"
"""The flag that sets a cycle aside only while enough others are left."""


@dataclass(frozen=True)
class StrideParams:
    """Criteria for counting a cycle.

    Parameters
    ----------
    min_s : shorter cycles are two events of one step; the detector cannot resolve shorter ones
        (docs/science/events.md, "Limits").
    max_s : longer cycles are stops, not strides (mobgap's stride rule: at most 3 s).
    bout_break_s : a walking bout ends if a foot makes no contact for longer (mobgap: 3 s; same place).
    turn_rad : heading change of the foot over a stride that counts as turning. Our choice: straight strides
        of gaitmap_foot and neura_walk stay within 15°, turning ones exceed 30°.
    turn_share : fraction of a stride inside the pelvis turning mask that counts as turning. Our choice.
    turn_margin : strides excluded on each side of a turn (two steps, as in clinical practice). In
        gaitmap_foot these six strides last 4 % longer, two standard deviations, than the steady ones.
    edge_strides : strides excluded at each end of a bout: gait starts and stops within them
        (docs/science/strides.md, "Flags").
    outlier_sd : a stride time that deviates from the foot's median by more than this number of robust
        standard deviations (1.4826 × median absolute deviation) …
    outlier_share : … and by more than this fraction of the median is an outlier. Our choice: natural gait
        variability stays below it, including the worst simulated patient; a stop inside a stride exceeds it.
    outlier_from : minimum number of strides of a foot for outlier detection. Our choice.
    run_strides : fewer consecutive cycles are a shift of weight, not walking. Our choice: two, the minimum
        for a repetition.
    min_kept : strides next to a turn are counted if fewer than this would be left on a foot. Our choice:
        three strides are the minimum for a meaningful spread; a notice `short_walk` is given.
    """

    min_s: float = 0.4
    max_s: float = 3.0
    bout_break_s: float = 3.0
    turn_rad: float = float(np.radians(20.0))
    turn_share: float = 0.25
    turn_margin: int = 1
    edge_strides: int = 1
    outlier_sd: float = 3.0
    outlier_share: float = 0.25
    outlier_from: int = 5
    run_strides: int = 2
    min_kept: int = 3


def flag_cycles(own: Sequence[Stride], params: StrideParams) -> list[Stride]:
    """The cycles of one foot in chronological order, with the flags from their neighbours added."""
    return [add_flag(s, *more) for s, more in zip(own, find_flags(own, params), strict=True)]


def find_flags(own: Sequence[Stride], params: StrideParams) -> list[set[StrideFlag]]:
    """Flags of each cycle of one foot in chronological order, its own and those from its neighbours."""
    more: list[set[StrideFlag]] = [set(s.flags) for s in own]
    for run in _runs(own, params):
        for i in run[: params.edge_strides]:
            more[i].add("first")
        for i in run[len(run) - params.edge_strides :]:
            more[i].add("last")
        if len(run) < params.run_strides:
            more[run[0]].add("non_periodic")
        for place in (place for place, i in enumerate(run) if "turn" in own[i].flags):
            for i in run[max(0, place - params.turn_margin) : place + params.turn_margin + 1]:
                if "turn" not in own[i].flags:
                    more[i].add("near_turn")
    for i in _outliers(own, params):
        more[i].add("outlier")
    return more


def add_flag(stride: Stride, *more: StrideFlag) -> Stride:
    """The cycle with additional flags, in canonical order."""
    if all(f in stride.flags for f in more):
        return stride
    return replace(stride, flags=tuple(f for f in ORDER if f in more or f in stride.flags))


def decide_exclusions(strides: Sequence[Stride], params: StrideParams) -> tuple[list[Stride], bool]:
    """Exclude cycles by the first of their flags; True if those next to a turn had to be counted."""
    strict = [_set_aside(s, next(iter(s.flags), None)) for s in strides]
    left = Counter(s.side for s in strict if s.excluded_reason is None)
    if all(left[s.side] >= params.min_kept for s in strict if s.excluded_reason == YIELDING):
        return strict, False
    return [_set_aside(s, _but_near_turn(s)) for s in strides], True


def _set_aside(stride: Stride, reason: StrideFlag | None) -> Stride:
    return stride if stride.excluded_reason == reason else replace(stride, excluded_reason=reason)


def _but_near_turn(stride: Stride) -> StrideFlag | None:
    return next((f for f in stride.flags if f != YIELDING), None)


def _runs(own: Sequence[Stride], params: StrideParams) -> list[list[int]]:
    """Indices of consecutive cycles without a break."""
    runs: list[list[int]] = [[]]
    for i, stride in enumerate(own):
        if stride.duration_s > params.bout_break_s:
            runs.append([])
        else:
            runs[-1].append(i)
    return [run for run in runs if run]


def _outliers(own: Sequence[Stride], params: StrideParams) -> list[int]:
    """Indices of complete cycles with a duration far from the foot's median."""
    whole = [i for i, s in enumerate(own) if _BROKEN.isdisjoint(s.flags)]
    if len(whole) < params.outlier_from:
        return []
    times = [own[i].duration_s for i in whole]
    middle = median(times)
    off = [abs(t - middle) for t in times]
    limit = max(params.outlier_sd * 1.4826 * median(off), params.outlier_share * middle)
    return [i for i, o in zip(whole, off, strict=True) if o > limit]
