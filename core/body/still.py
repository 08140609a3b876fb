"""Where a foot stands still, for zero-velocity updates, and where any sensor rests, for tilt.

Both are rules on the magnitude of angular rate and of specific force, so they need no orientation. A foot's
rule is the wide one: .7 rad/s and 1.2 m/s² find 14 of 14 stances of the real walk with none too many
(docs/science/real-recordings.md, "Contacts at rest"); what it lets through wrongly is the χ² gate's matter.
Events (core/events) say where contact begins and ends; the foot is flat and still only in a part of that
time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.frames import GRAVITY, Bools, Floats
from core.rest import find_runs


@dataclass(frozen=True)
class StillRule:
    """Still: |ω| and ||f| − g| below limits over a centred window, in runs of at least `shortest_s`."""

    gyr_limit: float
    acc_limit: float
    window_s: float
    shortest_s: float


FOOT_STILL = StillRule(0.7, 1.2, 0.06, 0.06)
"""A foot on the floor (docs/science/erkf.md, "Zero velocity")."""

AT_REST = StillRule(0.08, 0.25, 0.3, 0.3)
"""A sensor at rest: its specific force is gravity (docs/science/erkf.md, "Zero velocity")."""


def still_samples(acc: Floats, gyr: Floats, valid: Bools, rate_hz: float, rule: StillRule) -> Bools:
    """Samples (T,) at which one sensor is still; acc, gyr (T, 3), never where it is not valid."""
    quiet = (
        valid
        & (np.linalg.norm(gyr, axis=1) < rule.gyr_limit)
        & (np.abs(np.linalg.norm(acc, axis=1) - GRAVITY) < rule.acc_limit)
    )
    reach = round(rule.window_s * rate_hz) // 2
    loud = np.concatenate(([0], np.cumsum(~quiet)))
    index = np.arange(len(quiet))
    low, high = np.maximum(index - reach, 0), np.minimum(index + reach + 1, len(quiet))
    still = loud[high] == loud[low]
    for start, stop in find_runs(still):
        if stop - start < rule.shortest_s * rate_hz:
            still[start:stop] = False
    return np.asarray(still)
