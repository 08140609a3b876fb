"""Walking speed as norms are chosen by it: free of the length of the legs.

docs/science/norms-and-scores.md, "Speed". Dimensionless speed v / √(g L) (Hof 1996, Gait & Posture 4:222)
makes short and tall people alike. Norms are given for adults with legs of about 0.9 m, so a person's speed is
also told as the speed of such legs; where the height is not known it is the speed itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Final

from core.body.model import ANKLE_FRACTION, SHANK_FRACTION, THIGH_FRACTION
from core.frames import GRAVITY

LEG_M: Final = 0.9
"""Leg of the reference adults, hip to floor."""

SLOW_MPS: Final = 0.8
"""No adult reference exists for walking slower than this on such legs."""

WBDS_MPS: Final = (1.25, 0.16)
"""Mean and sd of the speed at which the adults of the angle norms walked."""


@dataclass(frozen=True)
class WalkingSpeed:
    """A person's speed beside that of the reference people.

    Parameters
    ----------
    speed_mps : as measured. leg_m : hip to floor, None = height not known.
    dimensionless : v / √(g L), None without the height.
    equivalent_mps : the same dimensionless speed on legs of 0.9 m; without the height the speed itself.
    """

    speed_mps: float
    leg_m: float | None
    dimensionless: float | None
    equivalent_mps: float

    @property
    def has_norm(self) -> bool:
        """Reference people walked as slowly as this."""
        return self.equivalent_mps >= SLOW_MPS


def walking_speed(speed_mps: float, height_m: float | None = None) -> WalkingSpeed:
    """Relate a speed to the legs that made it; leg length by Winter's fractions of the height."""
    if height_m is None:
        return WalkingSpeed(speed_mps, None, None, speed_mps)
    leg = (THIGH_FRACTION + SHANK_FRACTION + ANKLE_FRACTION) * height_m
    return WalkingSpeed(speed_mps, leg, speed_mps / sqrt(GRAVITY * leg), speed_mps * sqrt(LEG_M / leg))
