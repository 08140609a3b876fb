"""The conventions of the whole product: units, axes, quaternion order, segments, sides, joints.

World W: z up, right-handed, x = facing direction at standing, y = left; gravity (0, 0, −G).
Segment frames (ISB): x anterior, y proximal (up), z to the subject's right, on BOTH sides.
Quaternions: Hamilton, scalar first, mapping body coordinates to world coordinates.
Accelerometer: specific force, +G along the up axis at rest. SI units and radians everywhere.
Described in docs/reference/coordinate-systems.md; ISB axes: Wu et al. 2002.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal, get_args
from typing import Protocol as Shape

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

Segment = Literal["pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r", "chest"]
Side = Literal["left", "right"]
Protocol = Literal[
    "walk", "treadmill", "squat", "tug", "five_sit_to_stand", "walk_10m", "walk_6min",
    "standing_eyes_open", "standing_eyes_closed", "activity",
]  # fmt: skip
Posture = Literal["standing", "walking"]
"""What is neutral, and the zero of joint angles: standing, or flat feet and the mean of straight walking."""

SEGMENTS: Final[tuple[Segment, ...]] = get_args(Segment)
SIDES: Final[tuple[Side, ...]] = get_args(Side)
PROTOCOLS: Final[tuple[Protocol, ...]] = get_args(Protocol)

SUFFIX: Final[dict[Side, str]] = {"left": "l", "right": "r"}
"""Column-name suffix of a side: `hip_flexion_l_deg`."""

GRAVITY: Final = 9.80665
"""Standard gravity, m/s²."""

R_NEUTRAL: Final[Floats] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Segment-to-world matrix of a segment in neutral standing: x → x, y → z, z → −y."""
R_NEUTRAL.setflags(write=False)

FOOT: Final[dict[Side, Segment]] = {"left": "foot_l", "right": "foot_r"}
SHANK: Final[dict[Side, Segment]] = {"left": "shank_l", "right": "shank_r"}
THIGH: Final[dict[Side, Segment]] = {"left": "thigh_l", "right": "thigh_r"}


class Oriented(Shape):
    """Segments with their orientation over time: of a whole recording, or as stored with a finished
    analysis.
    """

    @property
    def t_s(self) -> Floats:
        """(n,) s from recording start."""

    @property
    def q(self) -> Mapping[Segment, Floats]:
        """Segment → (n, 4) segment to world, scalar first."""

    @property
    def valid(self) -> Mapping[Segment, Bools]:
        """Segment → (n,) sensor data available."""
