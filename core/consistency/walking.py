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
from sagittal.core.events.choice import measure_distance
from sagittal.core.events.result import GaitEvents
from sagittal.core.frames import SIDES, Floats
from sagittal.core.message import Message
from sagittal.core.rotation import find_lengths
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.recording import SensorSignals

TOGETHER: Final = 0.15
"""Share of a stride within which contacts of both feet are one landing. Walking feet land 0.42 to 0.64 of a
stride apart (medians of clean recordings)."""
MOST_TOGETHER: Final = 0.8
"""Largest share of such contacts, of either foot. Contacts of one foot detected twice reach 0.5."""
LEAST_CONTACTS: Final = 6
LONGEST_S: Final = 3.0
TILTING: Final = float(np.radians(50.0))
"""Median rate at which a trunk may tilt while it walks, rad/s, below `SLOW_HZ`. Clean ones reach 28 °/s;
shaken by hand 61 °/s and more."""
SLOW_HZ: Final = 3.0


def measure_coincidence(events: GaitEvents) -> float | None:
    """Share of contacts at which the other foot lands too, of the foot with fewer; None with few contacts."""
    shares = []
    for side, opposite_side in zip(SIDES, SIDES[::-1], strict=True):
        own, opposite = (np.array(events.times(s, "ic")) for s in (side, opposite_side))
        if min(len(own), len(opposite)) < LEAST_CONTACTS:
            return None
        strides = np.diff(own)
        walked = strides[strides < LONGEST_S]
        if not len(walked):
            return None
        shares.append(float(np.mean(measure_distance(own, opposite) < TOGETHER * np.median(walked))))
    return min(shares)


def judge_alternation(events: GaitEvents) -> Doubt | None:
    """A doubt where both feet land together."""
    together = measure_coincidence(events)
    if together is None or together <= MOST_TOGETHER:
        return None
    return Doubt(
        Notice(
            NOT_WALKING,
            Message(
                "Both feet land together at {together:.0f} % of their contacts. This is not walking, so gait "
                "parameters are not reported. Check that the sensors were worn.",
                together=100 * together,
            ),
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
            Message(
                "The sensor on {segment} tilts at {tilting:.0f} °/s (median; walking: below "
                "{limit:.0f}). This "
                "is not walking, so gait parameters are not reported. Check that the sensor was worn.",
                segment=segment,
                tilting=np.degrees(tilting),
                limit=np.degrees(TILTING),
            ),
            segment,
        ),
        "all",
    )
