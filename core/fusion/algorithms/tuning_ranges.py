"""Search ranges of gains by kind of number; the types of an algorithm's gains refer to them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class TuningRange:
    """Search range of a gain, uniform in its logarithm.

    Parameters
    ----------
    low, high : above 0. left : the search variable is 1 − the gain, which is a remaining fraction.
    """

    low: float
    high: float
    left: bool = False


RATE: Final = TuningRange(1e-4, 10.0)
"""1/s or rad/s."""
DRIFT: Final = TuningRange(1e-12, 1e-1)
"""1/s² or rad/s², of a gyroscope bias; the lower end is as good as none."""
SHARE: Final = TuningRange(1e-6, 1.0)
"""Of an error, taken out in a sample."""
LEFT: Final = TuningRange(1e-5, 1.0, left=True)
"""Of a disturbance, left after a sample."""
WEIGHT: Final = TuningRange(1e-3, 10.0)
"""Of one reading beside others."""
NOISE: Final = TuningRange(1e-4, 100.0)
"""Standard deviation in rad/s, or in shares of the norm at rest."""
VARIANCE: Final = TuningRange(1e-10, 1.0)
"""Of a state."""
WALK: Final = TuningRange(1e-9, 1e-2)
"""Of a bias, a √s."""
SAMPLES: Final = TuningRange(1.0, 1000.0)
"""At 100 Hz."""
DEVIATION: Final = TuningRange(1e-3, 1.0)
"""Of a norm from that at rest."""
TURNING: Final = TuningRange(1e-3, 20.0)
"""A threshold of the rate in rad/s."""
