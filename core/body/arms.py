"""Estimation of sensor positions and joint centres from motion and priors, with their uncertainty.

The two sensors at a joint observe the acceleration of one point, which determines their lever arms to it.
Soft tissue moves the sensors relative to the bone in the same way at every step, so a walk carries no more
information than a stride; the apparent movement of the joint in sensor axes during flexion is estimated along
with the arms. Nominal positions and lengths are the prior (docs/science/calibration.md, "Places and centres
from motion").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, radians
from typing import Final

import numpy as np

from sagittal.core.agreement.joints import LEG_JOINTS
from sagittal.core.body.arm_evidence import ARM, ARMS, ask_joint, name_kind, view_sensors
from sagittal.core.body.arm_params import ArmParams
from sagittal.core.body.model import BodyModel
from sagittal.core.body.places import joint_places, sensor_place
from sagittal.core.calibration.knee_axis import KneeAxes, measure_knees
from sagittal.core.errors import Notice
from sagittal.core.frames import Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.signals.calibrated import CalibratedRecording

LegJoint = tuple[Segment, Segment]
"""The segments on either side of a joint, proximal first."""

UP: Final = np.array([0.0, 1.0, 0.0])
"""The long axis of every segment."""

ACROSS: Final = np.array([True, True, False])
"""What is taken of a thigh: not the place across, which its skin's turning about the bone hides."""

TAPE_SD_M: Final = 0.005
"""How well a tape tells how far apart the ankles stand."""

BESIDE_SD_M: Final = 0.02
"""How far one ankle is ahead of the other while somebody stands with the feet side by side (our choice)."""

AHEAD_TOLD: Final = radians(15.0)
AHEAD_Z: Final = 3.0
"""A turn that all forward axes share is told beyond both: of neura_walk, qmt_fullbody and 16 simulated takes
the largest is 4°; with all axes turned by 30° they show 17 to 31°."""


@dataclass(frozen=True, eq=False)
class SensorPlace:
    """Position of one sensor in the axes of its segment.

    Parameters
    ----------
    guess, place, sd : (3,) m; nominal, as used, and its standard deviation. taken : (3,) components estimated
        from motion; the others are nominal.
    """

    guess: Floats
    place: Floats
    sd: Floats
    taken: Bools


@dataclass(frozen=True, eq=False)
class JointCentre:
    """Position of one joint centre in the axes of its proximal segment.

    Parameters
    ----------
    guess, centre, sd : (3,) m; nominal, as used, and its standard deviation. misfit : difference of the
        accelerations from both sensors, relative to their magnitude; None if not evaluated. asked : the
        estimate was used.
    """

    guess: Floats
    centre: Floats
    sd: Floats
    misfit: float | None
    asked: bool


@dataclass(frozen=True, eq=False)
class MeasuredArms:
    """Sensor positions and joint centres of one recording.

    Parameters
    ----------
    knees : knee hinge axes from rates alone; not used by the filter.
    ahead, ahead_sd : apparent common rotation of all forward axes to the right, rad: after undoing it,
        nominal positions fit best. If significant it is reported and the positions are rotated by it;
        otherwise they refer to the unchanged axes.
    """

    sensors: Mapping[Segment, SensorPlace]
    joints: Mapping[LegJoint, JointCentre]
    knees: Mapping[Side, KneeAxes]
    ahead: float
    ahead_sd: float

    @property
    def places(self) -> dict[Segment, Floats]:
        """Segment → (3,) sensor position in segment axes, m."""
        return {s: x.place for s, x in self.sensors.items()}

    @property
    def centres(self) -> dict[LegJoint, Floats]:
        """Joint → (3,) centre in the axes of the proximal segment, m."""
        return {j: x.centre for j, x in self.joints.items()}


def measure_arms(
    calibrated: CalibratedRecording,
    orientations: Orientations,
    body: BodyModel,
    segments: Sequence[Segment],
    params: ArmParams | None = None,
) -> MeasuredArms:
    """Estimate sensor positions and joint centres that fit the walk, its joints and the priors.

    Parameters
    ----------
    calibrated, orientations : with forward axes already aligned by the joints. segments : those in use.
    """
    params = params or ArmParams()
    usual = _Usual.of(body, segments, params)
    N, b = usual.weigh(params)
    if len(usual.nominal) == len(LEG_JOINTS):
        usual.stand_side_by_side(N, b, body.standing_width is not None)
    misfits, heard = _hear_joints(usual, N, b, calibrated, orientations, params)
    loose = np.linalg.inv(N)
    ahead, ahead_sd = float((loose @ b)[-1]), float(np.sqrt(loose[-1, -1]))
    if not _is_turned(ahead, ahead_sd):
        # the walk knows which way is ahead better than places do: given that, nothing is turned
        N, b = N[:-1, :-1], b[:-1]
    covariance = np.linalg.inv(N)
    fitted, fitted_sd = covariance @ b, np.sqrt(np.diag(covariance))
    sensors = {}
    for s, guess in usual.guesses.items():
        part = usual.part(s)
        moved = any(s in joint for joint in heard)
        observed = (ACROSS if name_kind(s) == "thigh" else np.ones(ARM, np.bool_)) & moved
        place = np.where(observed, fitted[part], guess)
        sensors[s] = SensorPlace(guess, place, np.where(observed, fitted_sd[part], usual.sd[part]), observed)
    joints = {}
    for joint, guess in usual.nominal.items():
        part = usual.part(joint)
        joints[joint] = JointCentre(
            guess, fitted[part], fitted_sd[part], misfits.get(joint), asked=joint in heard
        )
    return MeasuredArms(sensors, joints, measure_knees(calibrated), ahead, ahead_sd)


@dataclass(frozen=True, eq=False)
class _Usual:
    """Nominal sensor positions and joint centres: the unknowns of the fit, in order.

    Parameters
    ----------
    guesses : segment → (3,) sensor position. nominal : joint → (3,) centre. mean, sd : of all components, m.
        turns : (components,) their derivative by a rotation of the forward axes, m/rad.
    """

    guesses: Mapping[Segment, Floats]
    nominal: Mapping[LegJoint, Floats]
    mean: Floats
    sd: Floats
    turns: Floats

    @classmethod
    def of(cls, body: BodyModel, segments: Sequence[Segment], params: ArmParams) -> _Usual:
        """Nominal values from the body model."""
        nominal = {j: centre for j, (centre, _) in joint_places(body).items() if set(j) <= set(segments)}
        guesses = {s: sensor_place(s, body) for s in segments}
        mean = np.concatenate((*guesses.values(), *nominal.values()))
        sd = np.concatenate(
            [
                *(params.place_sd[name_kind(s)] for s in guesses),
                *(params.centre_sd[LEG_JOINTS[j]] for j in nominal),
            ]
        )
        # places and centres turn with the forward axes, of which the joints only know that they agree
        turns = np.concatenate([np.cross(UP, x) for x in (*guesses.values(), *nominal.values())])
        return cls(guesses, nominal, mean, sd, turns)

    def part(self, name: Segment | LegJoint) -> slice:
        """The components of a sensor or a joint."""
        first = ARM * (*self.guesses, *self.nominal).index(name)
        return slice(first, first + ARM)

    def weigh(self, params: ArmParams) -> tuple[Floats, Floats]:
        """Information matrix and vector of the prior, for all components and the common rotation of the
        forward axes, which is the last one.
        """
        unturned = np.concatenate((np.eye(len(self.mean)), -self.turns[:, None]), axis=1)
        N = unturned.T @ (self.sd[:, None] ** -2.0 * unturned)
        b = unturned.T @ (self.sd**-2.0 * self.mean)
        N[-1, -1] += params.ahead_sd**-2.0
        return N, b

    def stand_side_by_side(self, N: Floats, b: Floats, measured: bool) -> None:
        """Add the constraint that both legs end side by side, and, if the standing width was measured, at
        that distance.
        """
        stands = [(0, BESIDE_SD_M), *([(ARM - 1, TAPE_SD_M)] if measured else [])]
        for axis, spread_m in stands:
            apart = np.zeros(len(b))
            for joint in self.nominal:
                apart[self.part(joint).start + axis] = 1.0 if joint[1].endswith("_r") else -1.0
            apart[-1] = -(apart[:-1] @ self.turns)
            N += np.outer(apart, apart) / spread_m**2
            b += apart * (apart[:-1] @ self.mean) / spread_m**2

    def find_arms(self, joint: LegJoint) -> Floats:
        """Matrix (6, components + 1) that maps the components to both lever arms of a joint."""
        to_arms = np.zeros((ARMS, len(self.mean) + 1))
        for k, segment in enumerate(joint):
            to_arms[ARM * k : ARM * (k + 1), self.part(segment)] = -np.eye(ARM)
        to_arms[:ARM, self.part(joint)] = np.eye(ARM)
        return to_arms

    def spread(self, params: ArmParams) -> Floats:
        """Covariance of all components."""
        return np.diag(self.sd**2) + params.ahead_sd**2 * np.outer(self.turns, self.turns)


def _hear_joints(
    usual: _Usual,
    N: Floats,
    b: Floats,
    calibrated: CalibratedRecording,
    orientations: Orientations,
    params: ArmParams,
) -> tuple[dict[LegJoint, float], set[LegJoint]]:
    """Add the evidence of walking on each joint to N and b; returns the misfits of the joints, and those
    used.
    """
    misfits: dict[LegJoint, float] = {}
    heard: set[LegJoint] = set()
    sides, rate_hz = view_sensors(calibrated, orientations, tuple(usual.guesses), params)
    for joint in usual.nominal if sides else ():
        to_arms = usual.find_arms(joint)
        of_arms = to_arms[:, :-1]
        spread = of_arms @ usual.spread(params) @ of_arms.T
        evidence = ask_joint(sides[joint[0]], sides[joint[1]], of_arms @ usual.mean, spread, rate_hz, params)
        if evidence is None:
            continue
        misfits[joint] = evidence.misfit
        if evidence.misfit <= params.worst_misfit:
            heard.add(joint)
            N += to_arms.T @ evidence.L @ to_arms
            b += to_arms.T @ evidence.h
    return misfits, heard


def report_ahead(arms: MeasuredArms) -> tuple[Notice, ...]:
    """Notice `forward_against_places` if the sensor positions suggest a common rotation of all forward
    axes.
    """
    if not _is_turned(arms.ahead, arms.ahead_sd):
        return ()
    message = Message(
        "The sensor positions suggest that all anterior axes are rotated by about {degrees:.0f}° to the "
        f"{'right' if arms.ahead > 0.0 else 'left'}. Frontal and transverse angles are "
        "unreliable. Check sensor placement and that the person walked forward.",
        degrees=degrees(abs(arms.ahead)),
    )
    return (Notice("forward_against_places", message, severity="warning"),)


def _is_turned(ahead: float, ahead_sd: float) -> bool:
    """Whether a common rotation of all forward axes is significant."""
    return abs(ahead) > max(AHEAD_TOLD, AHEAD_Z * ahead_sd)
