"""Segment lengths of the lower body."""

from __future__ import annotations

from dataclasses import dataclass

from sagittal.core.subject.anthropometry import BodyMeasures, locate_hips_across

NOMINAL_HEIGHT_M = 1.70
"""Body height assumed when nobody gave one (±5 cm change joint angles by ±0.2°:
docs/science/body-model.md, "Lengths")."""

THIGH_FRACTION, SHANK_FRACTION, ANKLE_FRACTION, FOOT_FRACTION = 0.245, 0.246, 0.039, 0.152
"""Segment lengths as fractions of body height: Winter 2009, fig 4.1."""

LEG_FRACTION = 0.53
"""Leg length as a fraction of body height (Winter 2009, table 4.1)."""

HIP_FRACTION = 0.11
"""Distance of the hip centres as a fraction of body height (docs/science/body-model.md, "Lengths")."""


LENGTHS = ("hip_width", "thigh", "shank", "ankle_height", "foot")
"""What a body model has of everybody."""


@dataclass(frozen=True)
class BodyModel:
    """Lengths in m.

    Parameters
    ----------
    hip_width : between hip centres. thigh : hip to knee centre. shank : knee to ankle centre.
    ankle_height : ankle centre above the sole. foot : heel to toe.
    estimated : True if any length is derived from body height by Winter's fractions.
    standing_width : between the ankle centres while standing for calibration, None = not measured.
    sole_back, sole_front : horizontal distances from the ankle centre back to the rear end and forward to the
        tip of the shoe's sole, based on the nominal sensor position; sole_tip_up : height of the tip above
        the floor with the foot flat. None = not measured.
    measured : names of the tape-measured lengths; `hip_width` if derived from the measured pelvis.
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
    measured: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        # stored results have it as a list
        object.__setattr__(self, "measured", tuple(self.measured))

    @classmethod
    def from_height(cls, height_m: float, measures: BodyMeasures | None = None) -> BodyModel:
        """Measured lengths, the others as fractions of body height in m (Winter 2009, fig 4.1).

        For a measured leg, thigh, shank and ankle have the same proportions as in a leg derived from height.
        """
        tape = measures or BodyMeasures()
        leg_height = height_m if tape.leg_m is None else tape.leg_m / LEG_FRACTION
        lengths = {
            "hip_width": None
            if tape.pelvis_width_m is None
            else locate_hips_across(tape.pelvis_width_m, tape.pelvis_depth_m),
            "thigh": tape.thigh_m,
            "shank": tape.shank_m,
            "ankle_height": tape.ankle_height_m,
            "foot": tape.foot_m,
        }
        measured = {name: x for name, x in lengths.items() if x is not None}
        guessed = {
            "hip_width": HIP_FRACTION * height_m,
            "thigh": THIGH_FRACTION * leg_height,
            "shank": SHANK_FRACTION * leg_height,
            "ankle_height": ANKLE_FRACTION * leg_height,
            "foot": FOOT_FRACTION * height_m,
        }
        return cls(
            **guessed | measured, estimated=len(measured) < len(guessed), measured=tuple(sorted(measured))
        )
