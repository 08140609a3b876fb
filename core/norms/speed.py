"""Walking speed normalised to leg length for the selection of norms.

docs/science/norms-and-scores.md, "Speed". Dimensionless speed v / √(g L) (Hof 1996, Gait & Posture 4:222)
makes short and tall people comparable. The walkway norms are from adults with legs of about 0.9 m, so a
person's speed is also expressed as the equivalent speed of such legs; without a known height it is the speed
itself. The norms by speed use a shorter definition of leg length and therefore a separate dimensionless
speed.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Final

from sagittal.core.body.model import ANKLE_FRACTION, SHANK_FRACTION, THIGH_FRACTION
from sagittal.core.frames import GRAVITY

LEG_M: Final = 0.9
"""Leg of the reference adults, hip to floor."""

SLOW_MPS: Final = 0.8
"""Nobody in the tables of comfortable walking is slower than this on such legs."""

NORM_LEG_FRACTION: Final = 0.472
"""Leg over height of the adults of the norms by speed (Schreiber & Moissenet 2019)."""

NORM_LEG_SHARE: Final = 0.89
"""Their leg over a leg from the front of the pelvis to the ankle: 0.472 / 0.53."""

NORM_LEG_M: Final = 0.828
"""Their leg where nobody's height is known: that of the tables in m/s."""

SLOWEST: Final = 0.085
"""v* below which they did not walk (0.24 m/s on a leg of 0.828 m): a norm would be extrapolated."""

WBDS_MPS: Final = (1.25, 0.16)
"""Mean and sd of the speed at which the adults of the angle norms walked."""

COMFORTABLE: Final = WBDS_MPS[0] / sqrt(GRAVITY * NORM_LEG_M)
"""v* at which the norms by speed meet those of comfortable walking, 0.439; above it the latter hold."""

SPEED_SD: Final = 2.0
"""Standard deviations above the mean speed of the reference people up to which they are the norm (our choice:
nineteen in twenty of them walked no further from it)."""

FASTEST: Final = (WBDS_MPS[0] + SPEED_SD * WBDS_MPS[1]) / sqrt(GRAVITY * NORM_LEG_M)
"""v* above which no adult of the angle norms is expected, 0.551 (1.57 m/s on a leg of 0.828 m)."""


@dataclass(frozen=True)
class WalkingSpeed:
    """A person's speed relative to that of the reference people.

    Parameters
    ----------
    speed_mps : as measured. leg_m : hip to floor, None = height unknown.
    dimensionless : v / √(g L), None without the height.
    equivalent_mps : the same dimensionless speed for legs of 0.9 m; without the height the speed itself.
        norm_leg_m : leg length as defined by the norms by speed.
    """

    speed_mps: float
    leg_m: float | None
    dimensionless: float | None
    equivalent_mps: float
    norm_leg_m: float = NORM_LEG_M

    @property
    def is_slow(self) -> bool:
        """Whether it is slower than all people in the tables of comfortable walking."""
        return self.equivalent_mps < SLOW_MPS

    @property
    def is_fast(self) -> bool:
        """Whether it is faster than the adults of the angle norms."""
        return self.norm_speed > FASTEST

    @property
    def norm_speed(self) -> float:
        """Dimensionless speed v* as defined by the norms by speed."""
        return self.speed_mps / sqrt(GRAVITY * self.norm_leg_m)


def walking_speed(
    speed_mps: float, height_m: float | None = None, leg_m: float | None = None
) -> WalkingSpeed:
    """Relate a speed to leg length.

    Parameters
    ----------
    leg_m : measured from the front of the pelvis to the ankle; None = by Winter's fractions of the height.
    """
    if leg_m is None and height_m is None:
        return WalkingSpeed(speed_mps, None, None, speed_mps)
    if leg_m is not None:
        leg, norm_leg = leg_m, NORM_LEG_SHARE * leg_m
    else:
        leg = (THIGH_FRACTION + SHANK_FRACTION + ANKLE_FRACTION) * (height_m or 0.0)
        norm_leg = NORM_LEG_FRACTION * (height_m or 0.0)
    return WalkingSpeed(
        speed_mps, leg, speed_mps / sqrt(GRAVITY * leg), speed_mps * sqrt(LEG_M / leg), norm_leg
    )
