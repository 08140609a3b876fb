"""Detection of rests of a foot that are long enough to check its orientation against gravity."""

from __future__ import annotations

from math import radians
from typing import Final

import numpy as np

from sagittal.core.frames import Bools
from sagittal.core.signals.rest import count_runs

RESTED_S: Final = 0.1
"""Into a rest at which its tilt is looked at: a foot that lands or begins to roll is called still as well, up
to 14° off then."""

LOST_TILT: Final = radians(5.0)
"""Of gravity against the state in a foot's rest, beyond which the state is lost: a sensor that repeated
itself for 0.1 to 0.5 s in swing is 9 to 75° off, and every path after it half or three times as long; walks
of simulated people have at most 1.5°, neura_walk 1.6°."""


class RestLooks:
    """Samples `RESTED_S` into a rest of each of n feet, one per rest; independent of the division into
    blocks.
    """

    def __init__(self, n: int, rate_hz: float) -> None:
        self._rested, self._look = np.zeros(n, np.int64), max(1, round(RESTED_S * rate_hz))

    def push(self, still: Bools) -> Bools:
        """Check samples (T, n), from the rest of feet (T, n)."""
        return np.asarray(count_runs(still, self._rested) == self._look)
