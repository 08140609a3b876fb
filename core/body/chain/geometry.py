"""Lengths of one leg and positions of its three sensors, by the measures of Kianifar et al."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import cos, isfinite, pi, sin
from typing import Final

import numpy as np

from sagittal.core.body.model import LEG_FRACTION, NOMINAL_HEIGHT_M, SHANK_FRACTION, THIGH_FRACTION
from sagittal.core.calibration.fixed_offset import SHIN_FACE
from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats, Side
from sagittal.core.message import Message

PELVIS_WIDTH_FRACTION: Final = 0.137
"""Between the anterior superior iliac spines as a fraction of body height: own estimate, 24 cm at 1.75 m.
Winter's 0.191 is the breadth of the hips."""

LONGEST_M: Final = 2.0


def locate_hip(pelvis_width: float, pelvis_depth: float, leg_length: float) -> Floats:
    """Hip joint centre (3,) relative to the midpoint of the anterior iliac spines: forward, up, outward, m.

    References
    ----------
    Harrington et al. 2007, table 4, equations with several predictors, given there in mm;
    doi:10.1016/j.jbiomech.2006.02.003.
    """
    return np.array(
        [
            -0.24 * pelvis_depth - 0.0099,
            -0.16 * pelvis_width - 0.04 * leg_length - 0.0071,
            0.28 * pelvis_depth + 0.16 * pelvis_width + 0.0079,
        ]
    )


@dataclass(frozen=True)
class LegGeometry:
    """The fifteen body dimensions used by the chain, m (Kianifar, figures 2 and 3, table 1).

    Parameters
    ----------
    tibia, thigh : ankle to knee centre, knee to hip centre.
    tibia_to_knee, thigh_to_knee : sensor centre to the knee centre, along the bone.
    tibia_circumference, thigh_circumference : at the sensors; the radius is the outward offset.
    tibia_aside, thigh_aside : offset of the sensor from that line, inward. knee_forward, knee_inward,
        hip_forward, hip_inward : offset of the next joint centre from the long axis.
    pelvis_width, pelvis_depth, leg_length : for Harrington's hip joint centre.
    estimated : derived from body height, not measured.

    Raises
    ------
    ParameterError `length_implausible`.
    """

    side: Side
    tibia: float
    thigh: float
    pelvis_width: float
    leg_length: float
    tibia_to_knee: float = 0.08
    thigh_to_knee: float = 0.12
    tibia_circumference: float = 0.385
    thigh_circumference: float = 0.535
    pelvis_depth: float = 0.15
    tibia_aside: float = 0.0
    thigh_aside: float = 0.0
    knee_forward: float = 0.0
    knee_inward: float = 0.0
    hip_forward: float = 0.0
    hip_inward: float = 0.0
    estimated: bool = False

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.type != "float":
                continue
            length = getattr(self, field.name)
            least = 0.0 if field.name in POSITIVE else -LONGEST_M
            if not (isfinite(length) and least < length < LONGEST_M):
                raise ParameterError(
                    "length_implausible",
                    Message(
                        "{name} is {length:g} m; expected {least:g} to {LONGEST_M:g} m, in metres.",
                        name=field.name,
                        length=length,
                        least=least,
                        LONGEST_M=LONGEST_M,
                    ),
                )

    @classmethod
    def from_height(cls, height_m: float | None, side: Side) -> LegGeometry:
        """Lengths as fractions of body height in m, nominal height if not given; marked as estimated.

        The other dimensions are constants (docs/science/squat.md, "Measures of the body").
        """
        height = NOMINAL_HEIGHT_M if height_m is None else height_m
        return cls(
            side=side,
            tibia=SHANK_FRACTION * height,
            thigh=THIGH_FRACTION * height,
            pelvis_width=PELVIS_WIDTH_FRACTION * height,
            leg_length=LEG_FRACTION * height,
            estimated=True,
        )

    @property
    def outward(self) -> float:
        """Sign of the segments' z axis, which points to the right, in the outward direction."""
        return 1.0 if self.side == "right" else -1.0

    def knee_from_ankle(self) -> Floats:
        """Vector (3,) in shank axes."""
        return np.array([self.knee_forward, self.tibia, -self.outward * self.knee_inward])

    def hip_from_knee(self) -> Floats:
        """Vector (3,) in thigh axes."""
        return np.array([self.hip_forward, self.thigh, -self.outward * self.hip_inward])

    def tibia_sensor_from_ankle(self) -> Floats:
        """Vector (3,) in shank axes: on the flat side of the shin (table 1, with the sign of joint to
        sensor).
        """
        radius, aside = self.tibia_circumference / (2.0 * pi), self.tibia_aside
        forward = radius * cos(SHIN_FACE) - aside * sin(SHIN_FACE)
        inward = radius * sin(SHIN_FACE) + aside * cos(SHIN_FACE)
        return np.array([forward, self.tibia - self.tibia_to_knee, -self.outward * inward])

    def thigh_sensor_from_knee(self) -> Floats:
        """Vector (3,) in thigh axes: on the front of the thigh."""
        radius = self.thigh_circumference / (2.0 * pi)
        return np.array([radius, self.thigh_to_knee, -self.outward * self.thigh_aside])

    def back_sensor_from_hip(self) -> Floats:
        """Vector (3,) in pelvis axes: between the posterior iliac spines, −(V1 + V2) of figure 2."""
        hip = locate_hip(self.pelvis_width, self.pelvis_depth, self.leg_length)
        return -np.array([self.pelvis_depth + hip[0], hip[1], self.outward * hip[2]])


POSITIVE: Final = frozenset(
    {
        "tibia", "thigh", "tibia_to_knee", "thigh_to_knee", "tibia_circumference", "thigh_circumference",
        "pelvis_width", "pelvis_depth", "leg_length",
    }
)  # fmt: skip
"""Lengths that are above zero; the others are ways to one side."""
