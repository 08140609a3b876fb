"""The foot in swing: the leg follows the target angles, blended into the contact paths at both ends.

Stance is defined in world space, swing in joint space (docs/science/simulation.md, "Swing foot").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.rotation import about, multiply, rotate
from sagittal.core.simulate.gait.pelvis import hip_offset
from sagittal.core.simulate.gait.stance import StanceFoot, foot_orientation
from sagittal.core.simulate.gait.targets import (
    DEGREE,
    ankle_dorsiflexion,
    hip_adduction,
    hip_flexion,
    knee_flexion,
)
from sagittal.core.simulate.gait.timing import RELEASE_PHASE
from sagittal.core.simulate.shapes import bump, join, phase_bump, smooth_max, smoothstep
from sagittal.core.simulate.walker import SIGN, leg_reach

UP = np.array([0.0, 1.0, 0.0])
LEAVE, LAND = 0.22, 0.25
"""Shares of the swing over which the foot leaves the push-off path and takes on the landing path."""

HIP_STANDING = 10.0 * DEGREE
"""Hip flexion that comes with the pelvic tilt at rest, on top of half the knee's."""

LANDING_RISE = 14.0 * DEGREE
"""Rise of the pitch over the second half of swing, so that its maximum is at contact; without it the pitch
peaks up to 0.1 s early. A rise of 6° over the last 30 % leaves the pitch of those who land nearly flat level
for 0.1 s, and half a degree of error in an orientation then moves its maximum by 150 ms."""

TIP_FROM, TIP_TO = 0.50, 0.85
"""Shares of the swing between which the pitch takes on its landing path."""

ROLL = 5.0 * DEGREE
"""Supination of the free foot."""

HELD_BACK = 0.9
"""Up to this share of the swing the leg is kept from straightening; released at 0.86 the knee dips to its
least just before contact and the thigh shakes half as much again."""

MOST_LIFT = 0.095
"""Largest added lift for clearance, as a share of the leg (8 cm of 84)."""


@dataclass(frozen=True, eq=False)
class FootMotion:
    """One foot over the recording: ankle (n, 3) m; pitch, heading, roll (n,) rad; the lift of each swing,
    m.
    """

    ankle: Floats
    pitch: Floats
    heading: Floats
    roll: Floats
    lifts: tuple[float, ...]


def foot_motion(
    t: Floats, stance: StanceFoot, path: tuple[Floats, Floats, Floats], mid_hip: Floats, q_pelvis: Floats
) -> FootMotion:
    """Insert the swings between the contact paths, for a pelvis at `mid_hip` (n, 3), `q_pelvis` (n, 4)."""
    ankle, pitch, heading = (a.copy() for a in path)
    roll = np.zeros(len(t))
    hip = mid_hip + rotate(q_pelvis, hip_offset(stance.walker, stance.side))
    lifts = []
    for i, (release, contact) in enumerate(zip(stance.timing.release, stance.timing.contact, strict=True)):
        part = slice(int(np.searchsorted(t, release, side="right")) - 1, int(np.searchsorted(t, contact)) + 1)
        u = np.clip((t[part] - release) / (contact - release), 0.0, 1.0)
        swing = _swing(stance, i, t[part], u, hip[part], q_pelvis[part])
        ankle[part], pitch[part], heading[part], roll[part], lift = swing
        lifts.append(lift)
    return FootMotion(ankle, pitch, heading, roll, tuple(lifts))


def _swing(
    stance: StanceFoot, i: int, t: Floats, u: Floats, hip: Floats, q_pelvis: Floats
) -> tuple[Floats, Floats, Floats, Floats, float]:
    walker, side = stance.walker, stance.side
    previous, landing = stance.prints[i], stance.prints[i + 1]
    scale = walker.amplitude(landing.step_m)
    phase = RELEASE_PHASE + (1.0 - RELEASE_PHASE) * u

    free, lean = _free_leg(stance, i, phase, scale, hip, q_pelvis)
    dorsiflexion = ankle_dorsiflexion(walker.sides[side], phase) * (1.0 if scale > 0.5 else scale)
    heading = previous.foot_rad + (landing.path_rad - previous.path_rad) * smoothstep(u)
    free_pitch = dorsiflexion - np.arctan2(
        np.cos(heading) * lean[:, 0] + np.sin(heading) * lean[:, 1], lean[:, 2]
    )

    leaving_pitch = stance.push_off_pitch(i, t)
    # a foot that hardly pushes off hardly tips in the air
    tips = walker.sides[side].push * walker.landing_amplitude(landing.step_m)
    rise = LANDING_RISE * tips if walker.lands_rising else 0.0
    approach = rise * (1.0 - smoothstep((u - TIP_FROM) / (1.0 - TIP_FROM)))
    landing_pitch = stance.landing_pitch(i + 1) - approach
    air_pitch = free_pitch + join(u, leaving_pitch - free_pitch, landing_pitch - free_pitch)
    if walker.lands_rising:
        excess = smooth_max(air_pitch - landing_pitch, 0.0, 1.5 * DEGREE)
        air_pitch = air_pitch - smoothstep((u - 0.28) / 0.22) * excess

    leaving = 1.0 - smoothstep(u / LEAVE)
    arriving = smoothstep((u - 1.0 + LAND) / LAND)
    flying = 1.0 - leaving - arriving
    tipped = smoothstep((u - TIP_FROM) / (TIP_TO - TIP_FROM)) if walker.lands_rising else arriving
    pitch = leaving * leaving_pitch + tipped * landing_pitch + (1.0 - leaving - tipped) * air_pitch
    roll = SIGN[side] * ROLL * scale * bump(u)
    q = foot_orientation(heading, pitch, roll)
    off_path = stance.on_forefoot(i, q, pitch)
    on_path = stance.on_landing(i + 1, q, pitch)
    air = free + join(u, off_path - free, on_path - free)
    ankle = leaving[:, None] * off_path + arriving[:, None] * on_path + flying[:, None] * air

    ankle = _within_reach(stance, u, hip, ankle)
    hump = bump(u)
    lift = _needed_lift(stance, u, hump, ankle, q, pitch)
    ankle[:, 2] += lift * hump
    return ankle, pitch, heading, roll, lift


def _free_leg(
    stance: StanceFoot, i: int, phase: Floats, scale: float, hip: Floats, q_pelvis: Floats
) -> tuple[Floats, Floats]:
    """Ankle (n, 3) and shank axis (n, 3) in W for a leg that follows the target angles exactly."""
    walker, side = stance.walker, stance.side
    landing, gait = stance.prints[i + 1], walker.sides[side]
    rest_knee = walker.standing_knee_rad
    rest_hip = 0.5 * rest_knee + HIP_STANDING + walker.tilt_rad
    knee = knee_flexion(gait, phase) + landing.knee_rad * phase_bump(phase, 0.72, 0.20)
    flexion = hip_flexion(gait, phase) + landing.hip_rad * phase_bump(phase, 0.85, 0.30)
    knee = smooth_max(rest_knee + scale * (knee - rest_knee), gait.knee_min_rad + 1.5 * DEGREE, 1.5 * DEGREE)
    flexion = rest_hip + scale * (flexion - rest_hip)
    q_hip = multiply(about(2, flexion), about(0, SIGN[side] * hip_adduction(gait, phase)))
    q_thigh = multiply(q_pelvis, q_hip)
    shank = rotate(multiply(q_thigh, about(2, -knee)), UP)
    return hip - walker.anatomy.thigh * rotate(q_thigh, UP) - walker.anatomy.shank * shank, shank


def _within_reach(stance: StanceFoot, u: Floats, hip: Floats, ankle: Floats) -> Floats:
    """Move the free ankle towards the hip where the leg would be straighter than allowed."""
    walker = stance.walker
    limit = float(leg_reach(walker.anatomy, walker.sides[stance.side].knee_min_rad + DEGREE))
    along = ankle - hip
    length = np.linalg.norm(along, axis=1)
    shortened = length + limit - smooth_max(length, limit, 0.004 * walker.scale)
    free = smoothstep(u / 0.2) * (1.0 - smoothstep((u - HELD_BACK) / (1.0 - HELD_BACK)))
    return np.asarray(ankle + along * (free * (shortened / length - 1.0))[:, None])


def _needed_lift(
    stance: StanceFoot, u: Floats, hump: Floats, ankle: Floats, q: Floats, pitch: Floats
) -> float:
    """Height in m of the bump that keeps the sole clear of the floor at mid-swing."""
    walker = stance.walker
    clearance = walker.sides[stance.side].clearance_m * np.minimum(1.0, 3.0 * hump)
    need = clearance - stance.sole.lowest(ankle, q, pitch)
    middle = (u > 0.25) & (u < 0.85)
    most = MOST_LIFT * (walker.anatomy.thigh + walker.anatomy.shank)
    return float(np.clip(np.max(need / np.maximum(hump, 0.25), where=middle, initial=0.0), 0.0, most))
