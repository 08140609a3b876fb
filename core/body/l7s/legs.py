"""Sy's body model: its lengths, its frames and ours, and the legs from hip, ankle and hinge axis.

Sy's frames (docs/science/l7s.md, "Frames and symbols"): pelvis, thigh and shank x forward, y left, z up; foot
z from ankle to toe, y left, x down. The inclination of the line from ankle to toe relative to the sole's
forward axis is kept, so that it does not appear in our foot frame; if it is 0 the conversion is M_FOOT alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, hypot
from typing import Final

import numpy as np

from sagittal.core.body.kinematics import sole_points
from sagittal.core.body.model import BodyModel
from sagittal.core.errors import EstimationError
from sagittal.core.frames import FOOT, SHANK, THIGH, Floats, Segment, Side
from sagittal.core.message import Message
from sagittal.core.rotation import about, to_matrix

BODIES: Final[tuple[Segment, ...]] = ("pelvis", "foot_l", "foot_r")
"""Order of the three bodies of the state (paper: p, lf, rf)."""

LEGS: Final[tuple[Side, ...]] = ("left", "right")
"""Order of the legs in the state."""

HIP_SIDE: Final[dict[Side, float]] = {"left": 1.0, "right": -1.0}
"""Sign of the hip centre on the pelvis's y axis, which points left (paper eq 32)."""

FIGURE: Final[tuple[Segment, ...]] = (
    "pelvis",
    *(segment for side in LEGS for segment in (THIGH[side], SHANK[side], FOOT[side])),
)
"""Order of the segments of the figure."""

M_LEG: Final[Floats] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
M_FOOT: Final[Floats] = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""R_ISB = R_Sy M (docs/science/l7s.md, "Frames and symbols")."""
M_LEG.setflags(write=False)
M_FOOT.setflags(write=False)


@dataclass(frozen=True)
class LegModel:
    """Lengths in m of the model: three bodies and two hinged legs.

    Parameters
    ----------
    foot : from the ankle to the toe point on the floor, the ball. incline : of that line below the sole's
        forward axis, rad. hip_height : mid-hip above the floor in standing. foot_height : of the middle of
        the foot.
    """

    hip_width: float
    thigh: float
    shank: float
    foot: float
    incline: float
    ankle_height: float
    hip_height: float
    foot_height: float

    @classmethod
    def of(cls, body: BodyModel) -> LegModel:
        """The model of a person standing upright on flat feet.

        Raises
        ------
        EstimationError `segment_length` if a length is not positive and finite.
        """
        for name in ("hip_width", "thigh", "shank", "ankle_height", "foot"):
            length = getattr(body, name)
            if not (np.isfinite(length) and length > 0.0):
                raise EstimationError(
                    "segment_length",
                    Message(
                        "The body model's {name} is {length:g} m, expected above 0; enter the body height "
                        "or measure the segment.",
                        name=name,
                        length=length,
                    ),
                )
        forward, drop, _ = sole_points(body)[1]
        return cls(
            hip_width=body.hip_width,
            thigh=body.thigh,
            shank=body.shank,
            foot=hypot(forward, drop),
            incline=atan2(-drop, forward),
            ankle_height=body.ankle_height,
            hip_height=body.ankle_height + body.shank + body.thigh,
            foot_height=0.5 * body.ankle_height,
        )

    def to_isb(self, segment: Segment) -> Floats:
        """Matrix M (3, 3) of R_ISB = R_Sy M."""
        if segment.startswith("foot"):
            return np.asarray(M_FOOT @ to_matrix(about(2, self.incline)))
        return M_LEG


@dataclass(frozen=True, eq=False)
class Legs:
    """Pelvis and both legs, poses in our ISB frames.

    Parameters
    ----------
    q : (n, 7, 4), p : (n, 7, 3) of `FIGURE`, mid-hip for the pelvis, hip for thighs, knee for shanks, ankle
    for feet, m. reach : (n, 2) distance between ankle and hip of `LEGS`, m. hinge : (n, 2) distance of the
    hip from the plane of the foot, m, zero when the hinge constraint holds.
    """

    q: Floats
    p: Floats
    reach: Floats
    hinge: Floats


def solve_legs(R: Floats, p: Floats, model: LegModel) -> Legs:
    """Thighs, shanks and feet from pelvis and feet: the knee by the law of cosines.

    Parameters
    ----------
    R : (n, 3, 3, 3), p : (n, 3, 3) of BODIES in Sy's frames, foot position in its middle.

    References
    ----------
    Sy 2021 eq 40–44. If the leg is longer than thigh and shank (the cosine exceeds 1) the knee is straight.
    """
    from sagittal.core.body.l7s.leg_kernel import write_legs

    n = len(R)
    legs = Legs(np.empty((n, 7, 4)), np.empty((n, 7, 3)), np.empty((n, 2)), np.empty((n, 2)))
    write_legs(
        np.ascontiguousarray(R), np.ascontiguousarray(p), model.hip_width, model.thigh, model.shank,
        model.foot, np.array([HIP_SIDE[side] for side in LEGS]), M_LEG.copy(),
        np.array(model.to_isb("foot_l")), legs.q, legs.p, legs.reach, legs.hinge,
    )  # fmt: skip
    return legs
