"""Where the sensors sit and where the joints lie, from motion and from what is usual, each with its spread.

Two sensors beside a joint see the acceleration of one point: that shows the arms from both to it. Skin moves
the sensors over the bone with every step alike, so a walk says no more than a stride does; and how far the
joint wanders in a sensor's axes as the leg bends is estimated along with the arms. Nominal places and lengths
are the prior (docs/science/calibration.md, "Places and centres from motion").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees, radians
from typing import Final

import numpy as np

from sagittal.core.agreement.joints import LEG_JOINTS, JointKind
from sagittal.core.agreement.params import JointBandParams
from sagittal.core.agreement.terms import find_thinning, find_usable, low_pass_terms, take_mean_out
from sagittal.core.body.corrected import correct_signals
from sagittal.core.body.model import BodyModel
from sagittal.core.body.places import joint_places, sensor_place
from sagittal.core.calibration.knee_axis import KneeAxes, measure_knees
from sagittal.core.errors import Notice
from sagittal.core.frames import Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import conjugate, from_matrix, multiply, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.rest import index_window

LegJoint = tuple[Segment, Segment]
"""The segments on either side of a joint, proximal first."""

ARM: Final = 3
ARMS: Final = 2 * ARM
"""Both arms of a joint, proximal first."""

ROUNDS: Final = 6
SETTLED_M: Final = 1e-4

MARGIN_S: Final = 2.0
"""Filtered along on either side of the walk: what filters make of an end is not looked at."""

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


@dataclass(frozen=True)
class ArmParams:
    """How far places and centres may be from the nominal ones, and how far what is measured is believed.

    Parameters
    ----------
    place_sd : kind of segment → (3,) of the sensor's place along its axes, m. centre_sd : joint → (3,) of its
        centre in the proximal segment, m. wander_sd : kind of segment → how far a joint wanders in the
        sensor's axes for one radian of flexion, m/rad. turn_sd : of the turn between both sensors' headings,
        rad. noise_mps2 : least spread of the difference.
    stride_s : the whole walk counts as so much independent evidence. longest_s : so much walking is looked
        at. least_s : with less a joint says nothing. worst_misfit : of a joint's acceleration over its size,
        above which it says nothing. joints : which part of accelerations is compared.
    """

    place_sd: Mapping[str, tuple[float, float, float]] = field(
        default_factory=lambda: {
            "pelvis": (0.03, 0.04, 0.02),
            "thigh": (0.03, 0.06, 0.03),
            "shank": (0.02, 0.05, 0.03),
            "foot": (0.02, 0.02, 0.015),
        }
    )
    centre_sd: Mapping[JointKind, tuple[float, float, float]] = field(
        default_factory=lambda: {
            "hip": (0.01, 0.01, 0.01),
            "knee": (0.02, 0.015, 0.01),
            "ankle": (0.02, 0.015, 0.01),
        }
    )
    wander_sd: Mapping[str, float] = field(
        default_factory=lambda: {"thigh": 0.02, "shank": 0.01, "foot": 0.005}
    )
    turn_sd: float = radians(8.0)
    ahead_sd: float = radians(20.0)
    noise_mps2: float = 0.05
    stride_s: float = 1.1
    longest_s: float = 30.0
    least_s: float = 3.0
    worst_misfit: float = 0.9
    joints: JointBandParams = field(default_factory=JointBandParams)


@dataclass(frozen=True, eq=False)
class SensorPlace:
    """Where one sensor sits, in its segment's axes.

    Parameters
    ----------
    guess, place, sd : (3,) m; nominal, as used, and its standard deviation. taken : (3,) components in which
        motion was heard; the others are the guess.
    """

    guess: Floats
    place: Floats
    sd: Floats
    taken: Bools


@dataclass(frozen=True, eq=False)
class JointCentre:
    """Where one joint lies, in the axes of its proximal segment.

    Parameters
    ----------
    guess, centre, sd : (3,) m; nominal, as used, and its standard deviation. misfit : what both sensors'
        accelerations of it differ by, over its size; None where it was not asked. asked : it was heard.
    """

    guess: Floats
    centre: Floats
    sd: Floats
    misfit: float | None
    asked: bool


@dataclass(frozen=True, eq=False)
class MeasuredArms:
    """Places of the sensors and centres of the joints of one take.

    Parameters
    ----------
    knees : hinges of the knees from rates alone; the filter does not use them.
    ahead, ahead_sd : by how much all forward axes together seem turned to the right, rad: with axes turned
        back by it, usual places fit best. What is beyond doubt is told and the places turn with it; else they
        rest on the axes as they are.
    """

    sensors: Mapping[Segment, SensorPlace]
    joints: Mapping[LegJoint, JointCentre]
    knees: Mapping[Side, KneeAxes]
    ahead: float
    ahead_sd: float

    @property
    def places(self) -> dict[Segment, Floats]:
        """Segment → (3,) sensor in segment axes, m."""
        return {s: x.place for s, x in self.sensors.items()}

    @property
    def centres(self) -> dict[LegJoint, Floats]:
        """Joint → (3,) its centre in the axes of the proximal segment, m."""
        return {j: x.centre for j, x in self.joints.items()}


@dataclass(frozen=True, eq=False)
class _Side:
    """What one sensor says of the points of its segment while walking.

    M : (m, 3, 4) terms in W, columns along the segment's axes. wander : (m, 3, k) the acceleration of a point
    that wanders along these axes by 1 m for each radian of a flexion. wander_sd : how far one does, m/rad.
    usable : (m,).
    """

    M: Floats
    wander: Floats
    wander_sd: float
    usable: Bools


@dataclass(frozen=True, eq=False)
class _Evidence:
    """Information L (6, 6) about both arms of a joint and h = L · mean (6,); its misfit."""

    L: Floats
    h: Floats
    misfit: float


def measure_arms(
    calibrated: CalibratedRecording,
    orientations: Orientations,
    body: BodyModel,
    segments: Sequence[Segment],
    params: ArmParams | None = None,
) -> MeasuredArms:
    """Places and centres that fit the walk, its joints and what is usual.

    Parameters
    ----------
    calibrated, orientations : forward axes that agree with the joints already. segments : those in use.
    """
    params = params or ArmParams()
    nominal = {j: above for j, (above, _) in joint_places(body).items() if set(j) <= set(segments)}
    guesses = {s: sensor_place(s, body) for s in segments}
    column = {name: ARM * i for i, name in enumerate((*guesses, *nominal))}
    mean = np.concatenate((*guesses.values(), *nominal.values()))
    sd = np.concatenate(
        [
            *(params.place_sd[_kind(s)] for s in guesses),
            *(params.centre_sd[LEG_JOINTS[j]] for j in nominal),
        ]
    )
    # places and centres turn with the forward axes, of which the joints only know that they agree
    turns = np.concatenate([np.cross(UP, x) for x in (*guesses.values(), *nominal.values())])
    unturned = np.concatenate((np.eye(len(mean)), -turns[:, None]), axis=1)
    N, b = unturned.T @ (sd[:, None] ** -2.0 * unturned), unturned.T @ (sd**-2.0 * mean)
    N[-1, -1] += params.ahead_sd**-2.0
    if len(nominal) == len(LEG_JOINTS):
        # wherever along them the joints lie, both legs end side by side, and as far apart as the tape says
        stands = [(0, BESIDE_SD_M), *([] if body.standing_width is None else [(ARM - 1, TAPE_SD_M)])]
        for axis, spread_m in stands:
            apart = np.zeros(len(b))
            for joint in nominal:
                apart[column[joint] + axis] = 1.0 if joint[1].endswith("_r") else -1.0
            apart[-1] = -(apart[:-1] @ turns)
            N += np.outer(apart, apart) / spread_m**2
            b += apart * (apart[:-1] @ mean) / spread_m**2
    misfits: dict[LegJoint, float] = {}
    sides, rate_hz = _view_sides(calibrated, orientations, segments, params)
    heard = set()
    for joint in nominal if sides else ():
        to_arms = np.zeros((ARMS, len(b)))
        for k, segment in enumerate(joint):
            rows = slice(ARM * k, ARM * (k + 1))
            to_arms[rows, column[segment] : column[segment] + ARM] = -np.eye(ARM)
        to_arms[:ARM, column[joint] : column[joint] + ARM] = np.eye(ARM)
        of_arms = to_arms[:, :-1]
        spread = of_arms @ (np.diag(sd**2) + params.ahead_sd**2 * np.outer(turns, turns)) @ of_arms.T
        found = _ask_joint(sides[joint[0]], sides[joint[1]], of_arms @ mean, spread, rate_hz, params)
        if found is None:
            continue
        misfits[joint] = found.misfit
        if found.misfit <= params.worst_misfit:
            heard.add(joint)
            N += to_arms.T @ found.L @ to_arms
            b += to_arms.T @ found.h
    loose = np.linalg.inv(N)
    ahead, ahead_sd = float((loose @ b)[-1]), float(np.sqrt(loose[-1, -1]))
    if not _is_turned(ahead, ahead_sd):
        # the walk knows which way is ahead better than places do: given that, nothing is turned
        N, b = N[:-1, :-1], b[:-1]
    covariance = np.linalg.inv(N)
    fitted, fitted_sd = covariance @ b, np.sqrt(np.diag(covariance))
    sensors = {}
    for s, guess in guesses.items():
        part = slice(column[s], column[s] + ARM)
        moved = any(s in joint for joint in heard)
        taken = (ACROSS if _kind(s) == "thigh" else np.ones(ARM, np.bool_)) & moved
        place = np.where(taken, fitted[part], guess)
        sensors[s] = SensorPlace(guess, place, np.where(taken, fitted_sd[part], sd[part]), taken)
    joints = {}
    for joint, guess in nominal.items():
        part = slice(column[joint], column[joint] + ARM)
        joints[joint] = JointCentre(
            guess, fitted[part], fitted_sd[part], misfits.get(joint), asked=joint in heard
        )
    return MeasuredArms(sensors, joints, measure_knees(calibrated), ahead, ahead_sd)


def report_ahead(arms: MeasuredArms) -> tuple[Notice, ...]:
    """What the reader must know where sensors sit as if nobody had walked ahead: `forward_against_places`."""
    if not _is_turned(arms.ahead, arms.ahead_sd):
        return ()
    message = (
        f"The sensors sit as if every forward axis were turned by about {degrees(abs(arms.ahead)):.0f}° to "
        f"the {'right' if arms.ahead > 0.0 else 'left'}. Frontal and transverse angles are doubtful. Check "
        "where the sensors sit and that the person walked ahead."
    )
    return (Notice("forward_against_places", message, severity="warning"),)


def _is_turned(ahead: float, ahead_sd: float) -> bool:
    """Whether all forward axes are turned beyond doubt."""
    return abs(ahead) > max(AHEAD_TOLD, AHEAD_Z * ahead_sd)


def _kind(segment: Segment) -> str:
    """Segment without its side."""
    return segment.split("_")[0]


def _view_sides(
    calibrated: CalibratedRecording,
    orientations: Orientations,
    segments: Sequence[Segment],
    params: ArmParams,
) -> tuple[dict[Segment, _Side], float]:
    """Every sensor over the first of the straight walking, and the rate; empty without any."""
    rate = calibrated.recording.rate_hz
    walked = np.zeros(len(calibrated.recording.t_s), np.bool_)
    for window in calibrated.calibration.walking:
        walked[index_window(window, rate)] = True
    walked &= np.cumsum(walked) <= params.longest_s * rate
    if not walked.any():
        return {}, rate
    margin = round(MARGIN_S * rate)
    first, past = int(np.argmax(walked)), len(walked) - int(np.argmax(walked[::-1]))
    part = slice(max(0, first - margin), past + margin)
    walked = walked[part]
    thin = find_thinning(rate, params.joints)
    acc, gyr, valid = correct_signals(calibrated, segments, part)
    turned = {s: orientations.q[s][part] for s in segments}
    bends = [joint for joint in LEG_JOINTS if set(joint) <= set(segments)]
    # what is faster than the band is the sensors' own shaking, which no skin follows
    smooth = params.joints.band_hz[1]
    flexions = {
        (a, b): low_pass(_measure_flexion(turned[a], turned[b], walked)[None], smooth, rate)[0]
        for a, b in bends
    }
    sides = {}
    for i, segment in enumerate(segments):
        to_segment = calibrated.calibration.segments[segment].R_segment_sensor
        q = multiply(turned[segment], from_matrix(to_segment))
        slow, _ = low_pass_terms(q[None], acc[None, :, i], gyr[None, :, i], rate, params.joints)
        M = take_mean_out(slow, rate / thin, params.joints)[0]
        # a place in segment axes instead of sensor axes
        M[:, :, :ARM] = M[:, :, :ARM] @ to_segment.T
        # of the trunk flexion of both hips is one thing, and it has hardly any skin to speak of
        bent = [x for joint, x in flexions.items() if segment in joint and segment != "pelvis"]
        usable = find_usable(valid[:, i, None], rate)[0] & walked
        wander = _accelerate(turned[segment], bent, rate, thin, params)
        sides[segment] = _Side(M, wander, params.wander_sd.get(_kind(segment), 0.0), usable[::thin])
    return sides, rate / thin


def _measure_flexion(proximal: Floats, distal: Floats, walked: Bools) -> Floats:
    """Turn (n,) about the medio-lateral axis of two segments (n, 4) against each other, from its mean in
    walking, rad."""
    relative = multiply(conjugate(proximal), distal)
    turn = np.unwrap(2.0 * np.arctan2(relative[:, 3], relative[:, 0]))
    return np.asarray(turn - turn[walked].mean())


def _accelerate(
    q: Floats, flexions: Sequence[Floats], rate_hz: float, thin: int, params: ArmParams
) -> Floats:
    """Acceleration (m, 3, 3 k) in W, in the band, of points that wander along segment axes (n, 4) with each
    of k flexions (n,)."""
    if not flexions:
        return np.zeros((len(q[::thin]), 3, 0))
    low, high = params.joints.band_hz
    axes = to_matrix(q)
    ways = np.concatenate([axes * x[:, None, None] for x in flexions], axis=2)
    rows = low_pass(np.ascontiguousarray(ways.reshape(len(q), -1).T), high, rate_hz)
    step = 1.0 / rate_hz
    rows = np.gradient(np.gradient(rows, step, axis=1), step, axis=1)[:, ::thin]
    rows = rows - low_pass(rows, low, rate_hz / thin)
    return np.ascontiguousarray(rows.T).reshape(-1, 3, 3 * len(flexions))


def _ask_joint(
    first: _Side, second: _Side, arms: Floats, spread: Floats, rate_hz: float, params: ArmParams
) -> _Evidence | None:
    """What the two sensors beside a joint say of their arms to it; None where they hardly walked together.

    With turn and wandering as nuisances: Gauss-Newton from the nominal arms (6,), whose spread (6, 6) keeps
    the start near, then the nuisances marginalised.
    """
    seen = first.usable & second.usable
    n = int(np.count_nonzero(seen))
    if n < params.least_s * rate_hz:
        return None
    A, B = first.M[seen], second.M[seen]
    wander_a, wander_b = first.wander[seen], second.wander[seen]
    ka, kb = wander_a.shape[2], wander_b.shape[2]
    nuisance_sd = np.array([params.turn_sd, *[first.wander_sd] * ka, *[second.wander_sd] * kb])
    prior = np.zeros((ARMS + len(nuisance_sd),) * 2)
    prior[:ARMS, :ARMS] = np.linalg.inv(spread)
    prior[ARMS:, ARMS:] = np.diag(nuisance_sd**-2.0)
    start = np.concatenate((arms, np.zeros(len(nuisance_sd))))
    x, independent = start.copy(), min(n, 2.0 * params.joints.band_hz[1] * params.stride_s)
    for _ in range(ROUNDS):
        near = A[:, :, :ARM] @ x[:ARM] + A[:, :, ARM] + wander_a @ x[ARMS + 1 : ARMS + 1 + ka]
        far = B[:, :, :ARM] @ x[ARM:ARMS] + B[:, :, ARM] + wander_b @ x[ARMS + 1 + ka :]
        c, s = np.cos(x[ARMS]), np.sin(x[ARMS])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        far = far @ turn.T
        off = near - far
        sideways = np.stack((far[:, 1], -far[:, 0], np.zeros(n)), axis=1)
        J = np.concatenate(
            (A[:, :, :ARM], -(turn @ B[:, :, :ARM]), sideways[:, :, None], wander_a, -(turn @ wander_b)),
            axis=2,
        ).reshape(3 * n, -1)
        variance = float(np.mean(off**2))
        weight = independent / n / (variance + params.noise_mps2**2)
        H, g = weight * (J.T @ J), weight * (J.T @ off.reshape(-1))
        step = np.linalg.solve(H + prior, g + prior @ (x - start))
        x = x - step
        if np.abs(step[:ARMS]).max() < SETTLED_M:
            break
    misfit = float(np.sqrt(variance / max(float(np.mean(near**2)), 1e-12)))
    # the arms' own information: without the prior, which the whole body has
    H[ARMS:, ARMS:] += prior[ARMS:, ARMS:]
    g[ARMS:] += prior[ARMS:, ARMS:] @ (x + step)[ARMS:]
    eliminate = np.linalg.solve(H[ARMS:, ARMS:], H[ARMS:, :ARMS]).T
    L = H[:ARMS, :ARMS] - eliminate @ H[ARMS:, :ARMS]
    return _Evidence(L, L @ (x + step)[:ARMS] - (g[:ARMS] - eliminate @ g[ARMS:]), misfit)
