"""Whether it was a walk at all: sensors shaken in a hand have steps too.

Feet that walk land in turn, and a trunk that walks hardly tilts. Without either there is no gait to measure
(docs/science/consistency.md, "No walk").
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sagittal.core.consistency.doubt import NOT_WALKING, Doubt
from sagittal.core.errors import Notice
from sagittal.core.events.bouts import Bout
from sagittal.core.events.result import GaitEvents
from sagittal.core.frames import SIDES, Floats
from sagittal.core.rotation import find_lengths
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.recording import SensorSignals

PHASE: Final = (0.2, 0.8)
"""Share of a stride at which the other foot lands. Medians of clean recordings lie in 0.42 to 0.64."""
LEAST_STRIDES: Final = 5
LONGEST_S: Final = 3.0
TILTING: Final = float(np.radians(50.0))
"""Median rate at which a trunk may tilt while it walks, rad/s, below `SLOW_HZ`. Clean ones reach 28 °/s;
shaken by hand 61 °/s and more."""
SLOW_HZ: Final = 3.0


def measure_phase(events: GaitEvents) -> tuple[float, int]:
    """Median share of the left stride at which the right foot lands, and the strides it was read from."""
    left, right = (np.array(events.times(side, "ic")) for side in SIDES)
    if len(left) < 2 or not len(right):
        return float("nan"), 0
    start, end = left[:-1], left[1:]
    next_one = np.searchsorted(right, start)
    there = next_one < len(right)
    landed = right[np.minimum(next_one, len(right) - 1)]
    told = there & (landed < end) & (end - start < LONGEST_S)
    share = ((landed - start) / (end - start))[told]
    return (float(np.median(share)), len(share)) if len(share) else (float("nan"), 0)


def judge_alternation(events: GaitEvents) -> Doubt | None:
    """A doubt where both feet land together."""
    phase, strides = measure_phase(events)
    if strides < LEAST_STRIDES or PHASE[0] <= phase <= PHASE[1]:
        return None
    return Doubt(
        Notice(
            NOT_WALKING,
            f"Both feet land together (the right foot at {100 * phase:.0f} % of the left stride). This "
            "is not walking, so gait parameters are suppressed. Check that the sensors were worn.",
        ),
        "all",
    )


def measure_tilting(trunk: SensorSignals, t_s: Floats, bouts: Sequence[Bout], rate_hz: float) -> float | None:
    """Median rate about level axes within the bouts, rad/s; None without bouts.

    Parameters
    ----------
    trunk : signals at times t_s (n,) s.
    """
    inside = np.zeros(len(t_s), np.bool_)
    for b in bouts:
        inside[np.searchsorted(t_s, b.start_s) : np.searchsorted(t_s, b.end_s)] = True
    inside &= trunk.valid
    if not inside.any():
        return None
    up = np.median(trunk.acc[trunk.valid], axis=0)
    up /= max(float(np.linalg.norm(up)), 1e-9)
    rate = trunk.gyr - np.median(trunk.gyr[trunk.valid], axis=0)
    level = rate - np.outer(rate @ up, up)
    slow = low_pass(np.ascontiguousarray(level.T), SLOW_HZ, rate_hz).T
    return float(np.median(find_lengths(slow[inside])))


def judge_tilting(
    segment: str, trunk: SensorSignals, t_s: Floats, bouts: Sequence[Bout], rate_hz: float
) -> Doubt | None:
    """A doubt where a trunk tilts as none does that walks."""
    tilting = measure_tilting(trunk, t_s, bouts, rate_hz)
    if tilting is None or tilting <= TILTING:
        return None
    return Doubt(
        Notice(
            NOT_WALKING,
            f"The sensor on {segment} tilts at {np.degrees(tilting):.0f} °/s (median; walking: below "
            f"{np.degrees(TILTING):.0f}). This is not walking, so gait parameters are suppressed. Check "
            "that the sensor was worn.",
            segment,
        ),
        "all",
    )
