"""Chain of hinge joints with sensors on its links, and the leg as such a chain.

Where Kianifar et al. use Denavit-Hartenberg frames, a joint here is an axis and its offset from the previous
joint: the poses are the same (docs/science/squat.md, "Chain").
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.body.chain.geometry import LegGeometry
from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import R_NEUTRAL, SHANK, THIGH, Floats, Segment, Side
from sagittal.core.message import Message

FORWARD: Final = (1.0, 0.0, 0.0)
UP: Final = (0.0, 1.0, 0.0)
RIGHT: Final = (0.0, 0.0, 1.0)

LEG_AXES: Final = (UP, FORWARD, RIGHT, RIGHT, RIGHT, FORWARD, UP)
"""Ankle rotation, adduction, flexion; knee flexion; hip flexion, adduction, rotation, from the foot up."""

LEG_SENSORS: Final = (0, 3, 4, 7)
"""First joint below each sensor, and the number of joints: ankle 3, knee 1, hip 3."""

HIP_ROTATION: Final = 6

ABOUT_UP: Final = 0.02
"""Standard deviation at the start of the angles about the vertical, rad: standing is their zero."""
TILTS: Final = 2.0
"""Of the others before gravity was seen, rad."""


@dataclass(frozen=True, eq=False)
class RevoluteChain:
    """Serial hinge joints on a fixed base, with one sensor on the last link of each group.

    Parameters
    ----------
    axes : (J, 3) unit, and offsets : (J, 3) m from the previous joint, both in the axes of the link below the
        joint.
    first : (S + 1,) first joint of each sensor's group, ending with J.
    places : (S, 3) m of the sensors from the last joint of their group. mounts : (S, 3, 3) sensor to link.
    base : (3, 3) link of the base to world.
    bounded : (J,) True for angles constrained to about zero by a virtual sensor.
    start_sd : (J,) rad, initial uncertainty of the angles.

    Raises
    ------
    ParameterError `bad_shape`, `bad_joint`.
    """

    axes: Floats
    offsets: Floats
    first: tuple[int, ...]
    places: Floats
    mounts: Floats
    base: Floats
    bounded: tuple[bool, ...]
    start_sd: Floats

    def __post_init__(self) -> None:
        joints, sensors = len(self.axes), len(self.places)
        for name, array, shape in (
            ("axes", self.axes, (joints, 3)),
            ("offsets", self.offsets, (joints, 3)),
            ("places", self.places, (sensors, 3)),
            ("mounts", self.mounts, (sensors, 3, 3)),
            ("base", self.base, (3, 3)),
            ("start_sd", self.start_sd, (joints,)),
        ):
            if array.shape != shape or not np.isfinite(array).all():
                raise ParameterError(
                    "bad_shape",
                    Message(
                        "RevoluteChain: {name} has shape {shape}, expected {shape2}, finite.",
                        name=name,
                        shape=array.shape,
                        shape2=shape,
                    ),
                )
        groups = np.diff(self.first)
        if (
            len(self.first) != sensors + 1
            or self.first[0] != 0
            or self.first[-1] != joints
            or (groups < 1).any()
            or len(self.bounded) != joints
        ):
            raise ParameterError(
                "bad_joint",
                Message(
                    "RevoluteChain: {joints} joints are not split by {first}.",
                    joints=joints,
                    first=self.first,
                ),
            )
        if not np.allclose(np.linalg.norm(self.axes, axis=1), 1.0):
            raise ParameterError("bad_joint", "RevoluteChain: an axis is not of length 1.")

    def links(self, angles: Floats) -> list[Floats]:
        """World orientations (n, 3, 3) of the links that carry sensors, from angles (n, J)."""
        from sagittal.core.rotation import exp, to_matrix

        rotations, R = [], np.broadcast_to(self.base, (len(angles), 3, 3))
        for j, axis in enumerate(self.axes):
            R = R @ to_matrix(exp(angles[:, j : j + 1] * axis))
            if j + 1 in self.first:
                rotations.append(R)
        return rotations


def leg_segments(side: Side) -> tuple[Segment, Segment, Segment]:
    """Segments that carry the three sensors, from the foot up."""
    return SHANK[side], THIGH[side], "pelvis"


def require_leg(side: Side, available: Collection[Segment]) -> tuple[Segment, Segment, Segment]:
    """`leg_segments`, checked to be all available.

    Raises
    ------
    EstimationError `segments_missing`.
    """
    required = leg_segments(side)
    missing = [s for s in required if s not in available]
    if missing:
        raise EstimationError(
            "segments_missing",
            Message(
                "A squat requires sensors on {worn}; missing: {missing}.",
                worn=", ".join(required),
                missing=", ".join(missing),
            ),
            sensor=missing[0],
        )
    return required


def build_leg_chain(geometry: LegGeometry, mounts: Mapping[Segment, Floats]) -> RevoluteChain:
    """The leg above its neutral foot: seven hinges, three sensors.

    Parameters
    ----------
    mounts : segment → (3, 3) R_segment_sensor of shank, thigh and pelvis.

    Raises
    ------
    EstimationError `segments_missing`.
    """
    segments = require_leg(geometry.side, mounts)
    offsets = np.zeros((7, 3))
    offsets[3], offsets[4] = geometry.knee_from_ankle(), geometry.hip_from_knee()
    return RevoluteChain(
        axes=np.array(LEG_AXES),
        offsets=offsets,
        first=LEG_SENSORS,
        places=np.stack(
            (
                geometry.tibia_sensor_from_ankle(),
                geometry.thigh_sensor_from_knee(),
                geometry.back_sensor_from_hip(),
            )
        ),
        mounts=np.stack([np.asarray(mounts[s], np.float64) for s in segments]),
        base=R_NEUTRAL.copy(),
        bounded=tuple(j == HIP_ROTATION for j in range(7)),
        start_sd=np.array([ABOUT_UP if axis == UP else TILTS for axis in LEG_AXES]),
    )
