"""Sensor wear and alignment: gaps, non-wear, and the upright and forward directions.

Up is the mean direction of gravity while walking, which excludes lying. Forward is the direction of brief
trunk leans (docs/science/activity.md, "Upright and forward").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sagittal.core.activity.frames import FRAME_HZ, PER_MINUTE, Frames, Singles, measure_length
from sagittal.core.activity.params import UprightParams, WearParams
from sagittal.core.activity.result import UprightMethod, WearPeriod
from sagittal.core.frames import Bools, Floats
from sagittal.core.signals.rest import find_runs

Axis = tuple[float, float, float]


@dataclass(frozen=True)
class Wear:
    """Half-open frame ranges of gaps, of non-wear, and of wear between them."""

    gaps: tuple[tuple[int, int], ...]
    off: tuple[tuple[int, int], ...]
    worn: tuple[tuple[int, int], ...]


def find_wear(frames: Frames, params: WearParams) -> Wear:
    """Detect gaps and non-wear in consecutive frames."""
    n = len(frames.valid)
    gaps = tuple((a, b) for a, b in find_runs(~frames.valid) if b - a >= params.gap_s * FRAME_HZ)
    quiet = np.zeros(n, np.bool_)
    with np.errstate(invalid="ignore"):
        still = (frames.sd < params.sd).sum(axis=1) >= params.axes
        still &= (frames.wobble < params.wobble).all(axis=1)
    unmoved = frames.valid & (frames.spread < params.unmoved**2)
    for a, b in find_runs(still):
        if b - a >= params.still_min:
            first, end = a * PER_MINUTE, min(n, b * PER_MINUTE)
            # it was laid down within the minute before, and taken up within the one after
            first -= _count_while(unmoved[max(0, first - PER_MINUTE) : first][::-1])
            end += _count_while(unmoved[end : end + PER_MINUTE])
            quiet[first:end] = True
    for a, b in gaps:
        quiet[a:b] = False
    off = tuple(find_runs(quiet))
    non_wear = quiet
    for a, b in gaps:
        non_wear[a:b] = True
    return Wear(gaps, off, tuple(find_runs(~non_wear)))


def _count_while(mask: Bools) -> int:
    """Number of leading entries that are True."""
    return int(np.argmin(mask)) if len(mask) and not mask.all() else len(mask)


def group_periods(wear: Wear, params: WearParams) -> tuple[tuple[int, int], ...]:
    """Wear periods: stretches of wear separated by less than `still_min`."""
    periods: list[tuple[int, int]] = []
    for a, b in wear.worn:
        if periods and a - periods[-1][1] < params.still_min * PER_MINUTE:
            periods[-1] = (periods[-1][0], b)
        else:
            periods.append((a, b))
    return tuple(periods)


def find_upright(
    frames: Frames, walking: Bools, period: tuple[int, int], params: UprightParams
) -> tuple[Floats | None, UprightMethod]:
    """Unit axis (3,) of the sensor that points up while the person is upright, for one period."""
    part = slice(*period)
    walks = walking[part] & frames.valid[part]
    if np.count_nonzero(walks) >= params.walked_s * FRAME_HZ:
        return _middle(frames.gravity[part][walks]), "walking"
    length = round(params.still_s * FRAME_HZ)
    still = frames.valid[part] & (frames.spread[part] < params.still**2)
    still_run = next(((a, b) for a, b in find_runs(still) if b - a >= length), None)
    if still_run is None:
        return None, "none"
    first = period[0] + still_run[0]
    return _middle(frames.gravity[first : first + length]), "first_rest"


def _middle(gravity: Singles) -> Floats:
    """Component-wise median direction (3,) of directions (n, 3), as a unit vector."""
    middle = np.median(gravity / measure_length(gravity)[:, None], axis=0)
    return np.asarray(middle / np.linalg.norm(middle))


def find_forward(
    gravity: Singles, up: Floats, lean_frames: Sequence[tuple[int, int, int]], params: UprightParams
) -> tuple[Floats | None, int]:
    """Unit axis (3,) of the sensor that points forward, perpendicular to up, and the number of leans it is
    based on.

    Parameters
    ----------
    gravity : (f, 3). lean_frames : first, peak and last frame of every brief lean.
    """
    directions = []
    for a, top, b in lean_frames:
        unit = gravity[[a, top, b]] / measure_length(gravity[[a, top, b]])[:, None]
        lean = unit[1] - 0.5 * (unit[0] + unit[2])
        lean = lean - (lean @ up) * up
        size = float(np.linalg.norm(lean))
        if size >= np.sin(params.lean_rad):
            # what points up in the sensor moves backward when the trunk leans forward
            directions.append(-lean / size)
    if len(directions) < params.least:
        return None, len(directions)
    mean = np.mean(directions, axis=0)
    size = float(np.linalg.norm(mean))
    return (mean / size if size >= params.agreement else None), len(directions)


def describe_period(
    start_s: float, end_s: float, up: Floats | None, forward: Floats | None, method: UprightMethod, leans: int
) -> WearPeriod:
    """Convert a period to its result type."""
    return WearPeriod(start_s, end_s, _axis(up), _axis(forward), method, leans)


def _axis(v: Floats | None) -> Axis | None:
    return None if v is None else (float(v[0]), float(v[1]), float(v[2]))
