"""The kinematic tree of the pose filters: IMUs, and the joints that link them.

Filters know nothing about legs: they use sensors, joint centres in sensor axes, hinge axes and the set of
sensors that come to rest on the floor. Trees of people are built from a body model, the sensor-to-segment
alignment (calibration) and sensor positions (places.py). Sensors without a common joint, such as two feet
alone, are filtered independently.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from sagittal.core.body.model import LENGTHS, BodyModel
from sagittal.core.body.places import joint_places, sensor_place, standing_origin
from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import conjugate, from_matrix, rotate, to_matrix

Preset = Literal["lower_body7", "feet_pelvis3", "feet2", "single_foot_r", "single_foot_l"]

PRESETS: Final[Mapping[Preset, tuple[Segment, ...]]] = {
    "lower_body7": ("pelvis", "thigh_r", "shank_r", "foot_r", "thigh_l", "shank_l", "foot_l"),
    "feet_pelvis3": ("pelvis", "foot_r", "foot_l"),
    "feet2": ("foot_r", "foot_l"),
    "single_foot_r": ("foot_r",),
    "single_foot_l": ("foot_l",),
}
"""Sensors of each set-up, in the order of docs/science/erkf.md."""

HINGED: Final = "shank"
"""The knee is the joint with a hinge axis, z of thigh and shank; its distal segment begins so."""

COPIED: Final = 4096
"""Samples that are laid out for the kernel at a time: whole takes would be copied by the ten megabytes."""

LONGEST_M: Final = 2.0
"""A joint further from its sensor than this is a unit error."""


@dataclass(frozen=True, eq=False)
class Joint:
    """Two sensors that share a point, and an axis if the joint is a hinge.

    Parameters
    ----------
    proximal, distal : indices of the sensors. r_proximal, r_distal : (3,) joint centre in their axes, m.
    e_proximal, e_distal : (3,) unit hinge axis in their axes, or None.
    """

    name: str
    proximal: int
    distal: int
    r_proximal: Floats
    r_distal: Floats
    e_proximal: Floats | None = None
    e_distal: Floats | None = None


@dataclass(frozen=True, eq=False)
class ImuTree:
    """The sensor set-up as used by the filters.

    Parameters
    ----------
    imus : unique names, segments for a person. feet : indices of the sensors that rest on the floor.
    q_mount : (n, 4) sensor to segment axes. place : (n, 3) sensor in segment axes, m.
    origin : (n, 3) segment origins in W in neutral standing, m.

    Raises
    ------
    EstimationError `duplicate_segment`, `no_imu`, `segment_length`, `joint_unknown`, `joint_loop`.
    ParameterError `bad_shape`, `bad_joint`.
    """

    imus: tuple[str, ...]
    joints: tuple[Joint, ...]
    feet: tuple[int, ...]
    q_mount: Floats
    place: Floats
    origin: Floats

    def __post_init__(self) -> None:
        n = len(self.imus)
        if n == 0:
            raise EstimationError("no_imu", "The tree has no IMU; give at least one foot.")
        if len(set(self.imus)) != n:
            twice = next(s for s in self.imus if self.imus.count(s) > 1)
            raise EstimationError(
                "duplicate_segment",
                Message("{twice} has two sensors; exclude one of them.", twice=twice),
                sensor=twice,
            )
        for name, a, width in (
            ("q_mount", self.q_mount, 4),
            ("place", self.place, 3),
            ("origin", self.origin, 3),
        ):
            if a.shape != (n, width):
                raise ParameterError(
                    "bad_shape",
                    Message(
                        "ImuTree: {name} has shape {shape}, expected {value}.",
                        name=name,
                        shape=a.shape,
                        value=(n, width),
                    ),
                )
        group = list(range(n))
        for joint in self.joints:
            if (joint.e_proximal is None) != (joint.e_distal is None):
                raise ParameterError(
                    "bad_joint",
                    Message("ImuTree: {name} has one hinge axis of two; give both or none.", name=joint.name),
                )
            if not (
                0 <= joint.proximal < n and 0 <= joint.distal < n and all(0 <= foot < n for foot in self.feet)
            ):
                raise EstimationError(
                    "joint_unknown",
                    Message("{name} or a foot names a sensor out of 0…{value}.", name=joint.name, value=n),
                )
            for r in (joint.r_proximal, joint.r_distal):
                if not (np.isfinite(r).all() and np.linalg.norm(r) < LONGEST_M):
                    raise EstimationError(
                        "segment_length",
                        Message(
                            "{name} is {round} m from its sensor, expected within {LONGEST_M:g} m; "
                            "check the units of the body model.",
                            name=joint.name,
                            round=np.round(r, 3).tolist(),
                            LONGEST_M=LONGEST_M,
                        ),
                    )
            part, merged = group[joint.proximal], group[joint.distal]
            if part == merged:
                raise EstimationError(
                    "joint_loop",
                    Message("{name} closes a loop; a tree has one way to each IMU.", name=joint.name),
                )
            group = [part if g == merged else g for g in group]

    def roots(self) -> list[int]:
        """The first sensor of each connected part."""
        children = {j.distal for j in self.joints}
        return [i for i in range(len(self.imus)) if i not in children]

    def forward(self) -> Floats:
        """Anterior axes (n, 3) of the segments in sensor axes."""
        return rotate(conjugate(self.q_mount), np.array([1.0, 0.0, 0.0]))

    def segments(self, p: Floats, q: Floats) -> tuple[Floats, Floats]:
        """Segment orientations (..., n, 4) and origins (..., n, 3) in W.

        Parameters
        ----------
        p, q : (..., n, 3), (..., n, 4) of the sensors in W.
        """
        from sagittal.core.body.segment_kernel import write_segments

        n = len(self.imus)
        turned, origin = np.empty((q.size // (4 * n), n, 4)), np.empty((p.size // (3 * n), n, 3))
        p_flat, q_flat = p.reshape(origin.shape), q.reshape(turned.shape)
        for first in range(0, len(turned), COPIED):
            part = slice(first, first + COPIED)
            write_segments(
                np.ascontiguousarray(p_flat[part], np.float64),
                np.ascontiguousarray(q_flat[part], np.float64),
                self.q_mount,
                self.place,
                turned[part],
                origin[part],
            )
        return turned.reshape(q.shape), origin.reshape(p.shape)

    def segment(self, i: int, p: Floats, q: Floats) -> tuple[Floats, Floats]:
        """Orientation (T, 4) and origin (T, 3) of one segment in W; p (T, 3), q (T, 4) of its sensor."""
        one = replace(self, imus=self.imus[i : i + 1], joints=(), feet=(), q_mount=self.q_mount[i : i + 1],
                      place=self.place[i : i + 1], origin=self.origin[i : i + 1])  # fmt: skip
        turned, origin = one.segments(p[:, None], q[:, None])
        return turned[:, 0], origin[:, 0]

    def segment_q(self, q: Floats) -> Floats:
        """Segment orientations (..., n, 4) from sensor orientations (..., n, 4)."""
        return self.segments(np.broadcast_to(0.0, (*q.shape[:-1], 3)), q)[0]

    def segment_origin(self, p: Floats, q: Floats) -> Floats:
        """Segment origins (..., n, 3) in W from sensor positions (..., n, 3) and orientations (..., n, 4)."""
        return self.segments(p, q)[1]


def _check_mounts(mounts: Mapping[Segment, Floats], segments: Sequence[Segment]) -> None:
    missing = [s for s in segments if s not in mounts]
    if missing:
        raise EstimationError(
            "segments_missing",
            Message(
                "{len} of {segments} sensors are available, missing: {missing}; choose an estimator that "
                "suits the available sensors.",
                len=len(segments) - len(missing),
                segments=len(segments),
                missing=", ".join(missing),
            ),
            sensor=missing[0],
        )


def person_tree(
    body: BodyModel,
    mounts: Mapping[Segment, Floats],
    segments: Sequence[Segment],
    places: Mapping[Segment, Floats] | None = None,
    centres: Mapping[tuple[Segment, Segment], Floats] | None = None,
) -> ImuTree:
    """The tree of the available sensors; neighbours on the body are linked, knees are hinges.

    Parameters
    ----------
    mounts : segment → (3, 3) R_segment_sensor (`SegmentCalibration.R_segment_sensor`).
    segments : in this order, a `PRESETS` entry or any other set.
    places : segment → (3,) sensor position in segment axes, m; nominal if not given. centres : (proximal,
        distal) → (3,) joint centre in the axes of the proximal segment, m; from the body model if not given.

    Raises
    ------
    EstimationError `segments_missing` if one of `segments` has no mount, `segment_length` if a length of the
    body model is not positive; and those of `ImuTree`.
    """
    _check_mounts(mounts, segments)
    _check_lengths(body)
    q_mount = from_matrix(np.stack([mounts[s] for s in segments]))
    place = np.stack([(places or {}).get(s, sensor_place(s, body)) for s in segments])
    index = {s: i for i, s in enumerate(segments)}
    joints = []
    for (proximal, distal), (centre_proximal, centre_distal) in joint_places(body).items():
        if proximal not in index or distal not in index:
            continue
        centre_proximal = (centres or {}).get((proximal, distal), centre_proximal)
        i, j = index[proximal], index[distal]
        to_i, to_j = to_matrix(conjugate(q_mount[i])), to_matrix(conjugate(q_mount[j]))
        hinge = distal.startswith(HINGED)
        joints.append(
            Joint(
                name=f"{proximal}-{distal}",
                proximal=i,
                distal=j,
                r_proximal=to_i @ (centre_proximal - place[i]),
                r_distal=to_j @ (centre_distal - place[j]),
                e_proximal=to_i[:, 2].copy() if hinge else None,
                e_distal=to_j[:, 2].copy() if hinge else None,
            )
        )
    return ImuTree(
        imus=tuple(segments),
        joints=tuple(joints),
        feet=tuple(i for s, i in index.items() if s.startswith("foot")),
        q_mount=q_mount,
        place=place,
        origin=np.stack([standing_origin(s, body) for s in segments]),
    )


def walker3(leg_m: float = 0.92, hip_width_m: float = 0.39, pelvis_sensor_m: float = 0.08) -> ImuTree:
    """The three bodies of Potter et al. 2021: a pelvis and two straight legs on hip hinges, sensors aligned.

    Sensors are above the midpoint of the hips and at the ends of the legs (fig 1, data set 1).
    """
    lateral, up, axis = 0.5 * hip_width_m, np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    joints = tuple(
        Joint(f"hip_{s}", 0, i, out * axis * lateral - pelvis_sensor_m * up, leg_m * up, axis, axis)
        for s, i, out in (("r", 1, 1.0), ("l", 2, -1.0))
    )
    return ImuTree(
        imus=("pelvis", "leg_r", "leg_l"),
        joints=joints,
        feet=(1, 2),
        q_mount=np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)),
        place=np.array([pelvis_sensor_m * up, -leg_m * up, -leg_m * up]),
        origin=np.array([[0.0, 0.0, leg_m], [0.0, -lateral, leg_m], [0.0, lateral, leg_m]]),
    )


def _check_lengths(body: BodyModel) -> None:
    for name in LENGTHS:
        length = getattr(body, name)
        if not (np.isfinite(length) and 0.0 < length < LONGEST_M):
            raise EstimationError(
                "segment_length",
                Message(
                    "The body model's {name} is {length:g} m, expected between 0 and {LONGEST_M:g}; "
                    "enter the body height or measure the segment.",
                    name=name,
                    length=length,
                    LONGEST_M=LONGEST_M,
                ),
            )
