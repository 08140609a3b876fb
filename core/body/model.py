"""Segment lengths of the lower body."""

from __future__ import annotations

from dataclasses import dataclass

NOMINAL_HEIGHT_M = 1.70
"""Body height assumed when nobody gave one (±5 cm change joint angles by ±0.2°:
docs/science/body-model.md, "Lengths")."""

THIGH_FRACTION, SHANK_FRACTION, ANKLE_FRACTION, FOOT_FRACTION = 0.245, 0.246, 0.039, 0.152
"""Segment lengths as fractions of body height: Winter 2009, fig 4.1."""

HIP_FRACTION = 0.11
"""Distance of the hip centres as a fraction of body height (docs/science/body-model.md, "Lengths")."""


@dataclass(frozen=True)
class BodyModel:
    """Lengths in m.

    Parameters
    ----------
    hip_width : between hip centres. thigh : hip to knee centre. shank : knee to ankle centre.
    ankle_height : ankle centre above the sole. foot : heel to toe.
    estimated : True when taken from body height by Winter's fractions, False when measured.
    standing_width : between the ankle centres while standing for calibration, None = not measured.
    sole_back, sole_front : rear end and tip of the shoe's sole behind and in front of the ankle centre, by
        the nominal place of the sensor; sole_tip_up : how far the tip stands off the floor when the foot is
        flat. None = not measured.
    """

    hip_width: float
    thigh: float
    shank: float
    ankle_height: float
    foot: float
    estimated: bool
    standing_width: float | None = None
    sole_back: float | None = None
    sole_front: float | None = None
    sole_tip_up: float | None = None

    @classmethod
    def from_height(cls, height_m: float) -> BodyModel:
        """Lengths by fractions of body height in m (Winter 2009, fig 4.1), marked estimated."""
        return cls(
            hip_width=HIP_FRACTION * height_m,
            thigh=THIGH_FRACTION * height_m,
            shank=SHANK_FRACTION * height_m,
            ankle_height=ANKLE_FRACTION * height_m,
            foot=FOOT_FRACTION * height_m,
            estimated=True,
        )
