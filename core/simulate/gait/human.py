"""The seven bodies in motion: prescribed feet and pelvis, legs by closed-form inverse kinematics.

The feet are therefore exactly still in stance and the joint centres coincide to rounding
(docs/science/simulation.md, "Legs"). The knee is a hinge: its adduction and rotation are zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from sagittal.core.rotation import about, from_matrix, multiply, rotate
from sagittal.core.simulate.gait import pelvis
from sagittal.core.simulate.gait.chair import ChairChange, sit_and_rise
from sagittal.core.simulate.gait.stance import Sole, StanceFoot, foot_orientation
from sagittal.core.simulate.gait.swing import FootMotion, foot_motion
from sagittal.core.simulate.gait.timing import FootTiming, amplitude, body_phase, foot_timing, gait_phase
from sagittal.core.simulate.script import Plan
from sagittal.core.simulate.walker import SIGN, Walker

HINGE_FROM_PELVIS = 0.65
"""Share of the pelvis in the direction of the knee hinge; the rest follows the foot's heading."""


@dataclass(frozen=True, eq=False)
class BodyPath:
    """Position and orientation of each segment on a fine grid.

    Parameters
    ----------
    t_s : (n,). q : segment → (n, 4). p : segment → (n, 3) m, origins as in sagittal.core.body.poses.
    """

    t_s: Floats
    q: Mapping[Segment, Floats]
    p: Mapping[Segment, Floats]


@dataclass(frozen=True, eq=False)
class Motion(BodyPath):
    """Exact poses of a walk; t_s in steps of 1 / rate_hz.

    Parameters
    ----------
    timings : side → events of each swing. sole_height : side → (n,) lowest sole point, m.
    guard_m : largest lowering of the pelvis for a leg that would have been too short. lifts_m : side → lift
        of each swing added for clearance, which changes knee flexion.
    heading_rad : (n,) of the path, unwrapped, without pelvic rotation.
    """

    rate_hz: float
    plan: Plan
    walker: Walker
    timings: Mapping[Side, FootTiming]
    sole_height: Mapping[Side, Floats]
    guard_m: float
    lifts_m: Mapping[Side, tuple[float, ...]]
    heading_rad: Floats


def move(plan: Plan, walker: Walker, rate_hz: float, chair: tuple[ChairChange, ...] = ()) -> Motion:
    """Compute the poses of a plan on a grid of `rate_hz` (400 Hz or more intended).

    Parameters
    ----------
    chair : rises and sitting down during standing periods of the plan.

    Raises
    ------
    ParameterError : "step_too_long" if a leg cannot reach the planned position.
    """
    t = np.arange(round(plan.duration_s * rate_hz) + 1) / rate_hz
    timings = {s: foot_timing(plan, walker, s) for s in SIDES}
    phases = {s: gait_phase(t, plan, timings[s], rate_hz) for s in SIDES}
    phase = body_phase(t, plan, rate_hz)
    scale = amplitude(t, plan, walker, rate_hz)
    stances = {s: StanceFoot.of(plan, walker, s, timings[s]) for s in SIDES}
    paths = {s: stances[s].path(t) for s in SIDES}
    ankles = {s: paths[s][0] for s in SIDES}
    xy, heading = pelvis.floor_path(t, plan, walker, phase, scale, rate_hz)
    q_pelvis = pelvis.orient_pelvis(walker, heading, phase, phases, scale)

    shares = {s: pelvis.load_share(t, plan, timings, s) for s in SIDES}
    z = pelvis.compute_pelvis_height(plan, walker, phases, scale, shares, xy, q_pelvis, ankles, rate_hz)
    touching = {s: _touching(t, timings[s], margin_s=0.01) for s in SIDES}
    z, lowered = pelvis.guard(z, walker, xy, q_pelvis, ankles, touching, rate_hz)

    everywhere = {s: np.ones(len(t), bool) for s in SIDES}
    # the free feet hang on the pelvis, so a dip for one of them moves it: once more, then a last guard
    for _ in range(2):
        mid_hip = np.column_stack((xy, z))
        feet = {s: foot_motion(t, stances[s], paths[s], mid_hip, q_pelvis) for s in SIDES}
        z, dip = pelvis.guard(z, walker, xy, q_pelvis, {s: feet[s].ankle for s in SIDES}, everywhere, rate_hz)
        lowered = max(lowered, dip)
        if dip == 0.0:
            break
    mid_hip = np.column_stack((xy, z))
    if chair:
        seat, thigh = sit_and_rise(t, chair), walker.anatomy.thigh
        backward = np.stack((-np.cos(heading), -np.sin(heading), np.zeros(len(t))), axis=-1)
        mid_hip = mid_hip + thigh * (seat.back[:, None] * backward - seat.drop[:, None] * [0.0, 0.0, 1.0])
        q_pelvis = multiply(q_pelvis, about(2, -seat.pelvis_rad))

    q: dict[Segment, Floats] = {"pelvis": q_pelvis}
    p: dict[Segment, Floats] = {"pelvis": mid_hip}
    sole_height: dict[Side, Floats] = {}
    for s in SIDES:
        _leg(walker, s, feet[s], mid_hip, q_pelvis, q, p)
        sole_height[s] = Sole.of(walker).lowest(p[FOOT[s]], q[FOOT[s]], feet[s].pitch)
    lifts = {s: feet[s].lifts for s in SIDES}
    return Motion(t, q, p, rate_hz, plan, walker, timings, sole_height, lowered, lifts, heading)


def _touching(t: Floats, timing: FootTiming, margin_s: float) -> Bools:
    """Samples (n,) with the foot on the floor, widened by a margin."""
    free = np.zeros(len(t), bool)
    for release, contact in zip(timing.release, timing.contact, strict=True):
        free[
            np.searchsorted(t, release + margin_s, side="right") : np.searchsorted(t, contact - margin_s)
        ] = True
    return ~free


def _leg(
    walker: Walker,
    side: Side,
    foot: FootMotion,
    mid_hip: Floats,
    q_pelvis: Floats,
    q: dict[Segment, Floats],
    p: dict[Segment, Floats],
) -> None:
    """Add thigh, shank and foot of one side: the knee from hip, ankle and hinge axis in closed form."""
    thigh, shank = walker.anatomy.thigh, walker.anatomy.shank
    hip = mid_hip + rotate(q_pelvis, pelvis.hip_offset(walker, side))
    along = foot.ankle - hip
    length = np.linalg.norm(along, axis=1)[:, None]
    down = along / length
    right_of_foot = np.stack((np.sin(foot.heading), -np.cos(foot.heading), np.zeros(len(hip))), axis=-1)
    right_of_pelvis = rotate(q_pelvis, np.array([0.0, 0.0, 1.0]))
    hinge = HINGE_FROM_PELVIS * right_of_pelvis + (1.0 - HINGE_FROM_PELVIS) * right_of_foot
    hinge = _unit(hinge - np.sum(hinge * down, axis=1, keepdims=True) * down)
    cosine = (thigh**2 + length**2 - shank**2) / (2.0 * thigh * length)
    if cosine.max() > 1.0:
        when = float(np.argmax(cosine)) / max(len(cosine) - 1, 1)
        raise ParameterError(
            "step_too_long",
            f"The {side} leg ({thigh + shank:.2f} m) cannot reach its footprint at {when:.0%} of the script; "
            "use shorter steps or a taller person.",
        )
    forward = np.cross(-down, hinge)
    knee = hip + thigh * (cosine * down + np.sqrt(1.0 - cosine**2) * forward)
    for segment, top, bottom in ((THIGH[side], hip, knee), (SHANK[side], knee, foot.ankle)):
        up = _unit(top - bottom)
        q[segment] = from_matrix(np.stack((np.cross(up, hinge), up, hinge), axis=-1))
        p[segment] = top
    if walker.tibial_rotation_rad:
        # about the shank's own axis: joint centres stay where they are
        bent = np.sin(_knee_angle(thigh, shank, length[:, 0]))
        inward = SIGN[side] * walker.tibial_rotation_rad * bent
        q[SHANK[side]] = multiply(q[SHANK[side]], about(1, inward))
    q[FOOT[side]] = foot_orientation(foot.heading, foot.pitch, foot.roll)
    p[FOOT[side]] = foot.ankle


def _knee_angle(thigh: float, shank: float, length: Floats) -> Floats:
    """Knee flexion (n,) in rad of a leg with hip-ankle distance `length` (n,): the inverse of leg_reach."""
    return np.asarray(np.arccos((length**2 - thigh**2 - shank**2) / (2.0 * thigh * shank)))


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
