"""Detection of still feet for zero-velocity updates, and of resting sensors for tilt.

Both are rules on the magnitude of angular rate and specific force, so they need no orientation. The rule for
feet is the wider one: .7 rad/s and 1.2 m/s² detect 14 of 14 stances of the real walk without false ones
(docs/science/real-recordings.md, "Contacts at rest"); false detections are handled by the χ² gate. Events
(core/events) mark the beginning and end of contact; the foot is flat and still only during part of that time.
A brisk walker's foot never is: it rolls from heel to ball without a pause. If the rule detects nothing
between two swings, the quietest moment between them is used, weighted by how quiet it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sagittal.core.frames import GRAVITY, Bools, Floats
from sagittal.core.rotation import find_lengths
from sagittal.core.signals.rest import find_runs


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


@dataclass(frozen=True)
class QuietestRule:
    """Fallback for feet that never come to rest: the quietest moment of the stance.

    Activity is the greater of |ω| and ||f| − g|, each relative to its limit in `still`, as the maximum over
    its window: below 1 the foot is still. All values are our choice (docs/science/erkf.md, "Zero velocity").

    Parameters
    ----------
    apart_s : the moment must be the quietest within this time before and after: less than the stride of a
        brisk walker, more than from the middle of a slow swing to the still part of a stance.
    loudest : highest activity in a stance. Stances of ipol_walks reach 2.1, the quietest moments of swings
        start at 4.
    swing_rad_s, swing_s : the foot must swing within this time before and after.
    share : maximum ratio of |ω| to its peak within swing_s. Feet in ipol_walks have 0.02 to 0.05, few up to
        0.1; a shank labelled as a foot 0.10 to 0.15 (neura_walk, simulated people), a thigh at least 0.2.
    """

    still: StillRule = FOOT_STILL
    apart_s: float = 0.5
    loudest: float = 3.0
    swing_rad_s: float = 2.5
    swing_s: float = 1.0
    share: float = 0.075


QUIETEST = QuietestRule()


def contact_samples(
    acc: Floats, gyr: Floats, valid: Bools, rate_hz: float, rule: QuietestRule = QUIETEST
) -> tuple[Bools, Floats]:
    """Samples (T,) with a foot resting on the floor, and |ω| (T,) where it is not still there, else 0.

    Parameters
    ----------
    acc, gyr : (T, 3) m/s², rad/s. valid : (T,).
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    still = still_samples(acc, gyr, valid, rate_hz, rule.still)
    turning = find_lengths(gyr)
    force = np.abs(find_lengths(acc) - GRAVITY)
    loud = np.maximum(turning / rule.still.gyr_limit, force / rule.still.acc_limit)
    reach = round(rule.still.window_s * rate_hz) // 2
    loud = maximum_filter1d(np.where(valid, loud, np.inf), 2 * reach + 1, mode="nearest")
    apart, swing = round(rule.apart_s * rate_hz), round(rule.swing_s * rate_hz)
    # of a stance that the sensor did not see whole nobody knows the quietest moment
    least = minimum_filter1d(np.where(still | ~valid, 0.0, loud), 2 * apart + 1, mode="nearest")
    swings = np.concatenate(([0], np.cumsum(turning > rule.swing_rad_s)))
    quietest = np.zeros(len(still), np.bool_)
    for start, stop in find_runs((loud == least) & (loud <= rule.loudest) & ~still):
        k = (start + stop - 1) // 2
        lower, upper = max(0, k - swing), min(len(still), k + swing)
        window = slice(max(0, k - reach), k + reach + 1)
        slow = turning[window].max() <= rule.share * turning[lower:upper].max()
        if slow and swings[k] > swings[lower] and swings[upper] > swings[k]:
            quietest[window] = True
    return np.asarray(still | quietest), np.where(quietest & ~still, turning, 0.0)


def still_samples(acc: Floats, gyr: Floats, valid: Bools, rate_hz: float, rule: StillRule) -> Bools:
    """Samples (T,) at which one sensor is still; acc, gyr (T, 3); invalid samples never are."""
    quiet = (
        valid & (find_lengths(gyr) < rule.gyr_limit) & (np.abs(find_lengths(acc) - GRAVITY) < rule.acc_limit)
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
