"""Spread of the filters: over time, over the gait cycle, and of each from their median."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from sagittal.core.events.result import Stride, Strides
from sagittal.core.filter_comparison.result import FilterSpread
from sagittal.core.frames import SIDES, SUFFIX, Bools, Floats, Segment, Side
from sagittal.core.fusion.algorithms.benchmark import OrientationScore, score_error
from sagittal.core.parameters.kinematic import POINTS
from sagittal.core.parameters.resample import resample
from sagittal.core.rotation import conjugate, exp, log, multiply, split_heading, wrap_angle


def find_median(q: Floats, near: Floats) -> Floats:
    """Median orientation (m, 4) of filters (F, m, 4): per axis of the rotation from `near` (m, 4), in W."""
    apart = log(multiply(q, conjugate(near)))
    return multiply(exp(np.median(apart, axis=0)), near)


def score_between(q: Floats, second: Floats, valid: Bools) -> OrientationScore | None:
    """RMS of the angle between two orientations (m, 4) where valid (m,); None without valid samples."""
    return score_error(multiply(second[valid], conjugate(q[valid]))) if valid.any() else None


def pool_scores(scores: Sequence[OrientationScore]) -> OrientationScore | None:
    """RMS over segments with equal numbers of samples; None without any."""
    if not scores:
        return None
    means = [
        float(np.sqrt(np.mean([getattr(s, name) ** 2 for s in scores])))
        for name in ("total", "heading", "inclination")
    ]
    return OrientationScore(*means)


def spread_of_segment(
    segment: Segment, q: Floats, near: Floats, valid: Bools
) -> tuple[dict[str, tuple[Floats, Floats]], Floats]:
    """Spread of filters (F, m, 4) in one segment by quantity: SD and range (m,) in rad; and their median."""
    median = find_median(q, near)
    tilt, turn = split_heading(multiply(q, conjugate(median)))
    lost = ~valid
    spreads = {
        f"{segment}_inclination": (
            np.linalg.norm(tilt.std(axis=0), axis=-1),
            np.linalg.norm(np.ptp(tilt, axis=0), axis=-1),
        ),
        f"{segment}_heading": (turn.std(axis=0), np.ptp(turn, axis=0)),
    }
    for sd, reach in spreads.values():
        sd[lost] = reach[lost] = np.nan
    return spreads, median


def spread_of_angles(
    angles: Sequence[Mapping[str, Floats]], near: Mapping[str, Floats]
) -> dict[str, tuple[Floats, Floats, int]]:
    """Spread of joint angles between filters by name: SD, range (m,) in rad, and number of filters."""
    spreads = {}
    for name, own in near.items():
        rows = [wrap_angle(x[name] - own) for x in angles if name in x]
        if rows:
            apart = np.stack(rows)
            spreads[name] = (apart.std(axis=0), np.ptp(apart, axis=0), len(rows))
    return spreads


def cut_into_cycles(
    name: str, filters: int, sd: Floats, reach: Floats, t_s: Floats, strides: Strides
) -> FilterSpread:
    """A spread over time, and its RMS over the counted strides of its side."""
    _, _, suffix = name.removesuffix("_inclination").removesuffix("_heading").rpartition("_")
    own = [side for side in SIDES if SUFFIX[side] == suffix]
    cycle: dict[Side, Floats] = {}
    stance: dict[Side, float | None] = {}
    swing: dict[Side, float | None] = {}
    for side in own or SIDES:
        valid_strides = [s for s in strides.strides if s.side == side and s.excluded_reason is None]
        if not valid_strides:
            continue
        whole = _square(sd, t_s, [(s.start_s, s.end_s) for s in valid_strides])
        if whole is None:
            continue
        cycle[side] = np.sqrt(whole)
        stance[side], swing[side] = (_phase(sd, t_s, valid_strides, phase) for phase in ("stance", "swing"))
    return FilterSpread(name, filters, sd, reach, cycle, stance, swing)


def _phase(sd: Floats, t_s: Floats, strides: Sequence[Stride], phase: str) -> float | None:
    ends = [
        (s.start_s, s.tc_s) if phase == "stance" else (s.tc_s, s.end_s) for s in strides if s.tc_s is not None
    ]
    square = _square(sd, t_s, ends)
    return None if square is None else float(np.sqrt(square.mean()))


def _square(sd: Floats, t_s: Floats, bounds: Sequence[tuple[float, float]]) -> Floats | None:
    """Mean square (101,) over segments of a signal; None if no segment is completely known."""
    if not bounds:
        return None
    rows = resample(sd[None], t_s, np.array(bounds), POINTS)[0]
    rows = rows[np.isfinite(rows).all(axis=1)]
    return np.asarray((rows**2).mean(axis=0)) if len(rows) else None


MOST_SAMPLES: Final = 30_000
KEPT_HZ: Final = 50.0
"""Of what filters give, samples that are kept at most, and per second: 37 filters on seven sensors for ten
minutes are 0.5 GB in full. A filter itself sees every sample."""


def choose_samples(n: int, rate_hz: float) -> slice:
    """Which of n samples are used to compare filters."""
    return slice(0, n, max(1, round(rate_hz / KEPT_HZ), -(-n // MOST_SAMPLES)))
