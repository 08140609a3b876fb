"""Causal detection of still feet and resting sensors, with a trailing window.

Offline the window is centred (core/body/still.py) and ends before the foot moves; here the last samples of a
rest already include the beginning of heel rise. The cost was measured on gaitmap_foot, neura_walk and seven
simulated people: a longer or stricter window misses short rests (stride lengths of gaitmap_foot ± 70 mm
instead of ± 30), and strides become up to 8 mm shorter, because a foot that begins to roll still counts as
stationary. The remedy is to increase its uncertainty: see `ROLLING_MPS`.
"""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from sagittal.core.body.still import AT_REST, FOOT_STILL
from sagittal.core.frames import GRAVITY, Bools, Floats

FOOT_S: Final = 0.03
"""A foot that has been quiet for so long stands. Half the offline window, so that it starts as early."""

ROLLING_MPS: Final = 0.04
"""What a foot that is called still may move: at the rule's limit of 0.7 rad/s a sensor 6 cm from the ball on
which it rolls. As deviation of zero velocity it takes the SD of stride lengths on gaitmap_foot from 30 and 18
to 25 and 19 mm, and halves the shortening on seven virtual people; 0.01 is right where the window stops
before the foot moves."""

LIMITS: Final[Floats] = np.array([[r.gyr_limit, r.acc_limit] for r in (FOOT_STILL, AT_REST)])
"""(rule, 2): |ω| and ||f| − g| of a foot that stands and of a sensor at rest."""
LIMITS.setflags(write=False)


def count_needed_samples(rate_hz: float) -> tuple[int, int]:
    """Consecutive quiet samples, including the current one, required for a still foot and for a resting
    sensor.
    """
    return max(1, round(FOOT_S * rate_hz)), max(1, round(AT_REST.window_s * rate_hz))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def count_trailing_samples(acc, gyr, valid, limits, need, quiet, still):  # type: ignore[no-untyped-def]
    """Count consecutive quiet samples and mark still ones.

    Parameters
    ----------
    acc, gyr : (T, n, 3). valid : (T, n). limits : (2, 2). need : (2,). quiet : (n, 2) counts so far, advanced
        in place. still : (T, n, 2) written: still foot, resting sensor.
    """
    for k in range(acc.shape[0]):
        for i in range(acc.shape[1]):
            rate = force = 0.0
            for c in range(3):
                rate += gyr[k, i, c] ** 2
                force += acc[k, i, c] ** 2
            rate, off = np.sqrt(rate), abs(np.sqrt(force) - GRAVITY)
            for r in range(2):
                calm = valid[k, i] and rate < limits[r, 0] and off < limits[r, 1]
                quiet[i, r] = quiet[i, r] + 1 if calm else 0
                still[k, i, r] = quiet[i, r] >= need[r]


class StillnessDetector:
    """The rule on n sensors, block by block; results are bit-identical for any division into blocks."""

    def __init__(self, n: int, rate_hz: float) -> None:
        self._need = np.array(count_needed_samples(rate_hz), np.int64)
        self._quiet = np.zeros((n, 2), np.int64)

    def push(self, acc: Floats, gyr: Floats, valid: Bools) -> Bools:
        """Mask (T, n, 2): still foot, resting sensor; acc, gyr (T, n, 3) corrected, valid (T, n)."""
        still = np.empty((*valid.shape, 2), np.bool_)
        count_trailing_samples(acc, gyr, valid, LIMITS, self._need, self._quiet, still)
        return still
