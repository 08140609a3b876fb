"""The pelvis: its horizontal path, its angles, and its height from the knee of the loaded leg.

Height from the loaded knee (not from a fixed vertical wave) brings the stance knee to the norm
(docs/science/simulation.md, "Pelvis").
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import maximum_filter1d

from sagittal.core.frames import SIDES, Bools, Floats, Side
from sagittal.core.rotation import about, multiply, rotate
from sagittal.core.simulate.gait.curves import PELVIS_OBLIQUITY, PELVIS_ROTATION, PELVIS_TILT
from sagittal.core.simulate.gait.stance import Q_NEUTRAL
from sagittal.core.simulate.gait.targets import DEGREE, knee_flexion
from sagittal.core.simulate.gait.timing import FootTiming, size_window
from sagittal.core.simulate.script import Plan
from sagittal.core.simulate.shapes import phase_bump, smooth, smooth_max, smoothstep
from sagittal.core.simulate.walker import SIGN, Walker, leg_reach

FULL_FORWARD = 0.94
"""From this share of the reference step on the pelvis is fully ahead of the feet at contact."""

GUARD_S = 0.16
"""Width of a dip of the pelvis where a leg would have to be longer than it is."""


def hip_offset(walker: Walker, side: Side) -> Floats:
    """Hip centre (3,) in the pelvis frame, m."""
    return np.array([0.0, 0.0, SIGN[side] * walker.anatomy.hip_width / 2.0])


def floor_path(
    t: Floats, plan: Plan, walker: Walker, phase: Floats, amplitude: Floats, rate_hz: float
) -> tuple[Floats, Floats]:
    """Horizontal position of mid-hip (n, 2) in m, and heading of the path (n,) in rad, unwrapped.

    Knots at each contact (midpoint of the feet, slightly ahead) and at mid-step (towards the stance foot).
    """
    feet = {s: np.array([plan.footprints[s][0].x_m, plan.footprints[s][0].y_m]) for s in SIDES}
    headings = dict.fromkeys(SIDES, 0.0)
    times, places, yaws = [0.0], [0.5 * (feet["left"] + feet["right"])], [0.0]
    for step in plan.steps:
        if step.opens:
            times.append(step.start_s)
            places.append(places[-1])
            yaws.append(yaws[-1])
        feet[step.side] = np.array([step.x_m, step.y_m])
        headings[step.side] = step.path_rad
        trailing: Side = "left" if step.side == "right" else "right"
        stance_foot = feet[trailing]
        ahead = np.array([np.cos(step.path_rad), np.sin(step.path_rad)])
        share = (
            0.0 if step.closes else min(1.0, max(step.step_m, 0.0) / (FULL_FORWARD * walker.reference_step_m))
        )
        lead = share * walker.forward_m * walker.sides[trailing].trailing_factor
        place = 0.5 * (feet["left"] + feet["right"]) + lead * ahead
        halfway = 0.5 * (places[-1] + place)
        aside = stance_foot - halfway
        middle = halfway + walker.lateral * (aside - (aside @ ahead) * ahead)
        yaw = 0.5 * (headings["left"] + headings["right"])
        times += [step.time_s - 0.5 * step.step_s, step.time_s]
        places += [middle, place]
        yaws += [0.5 * (yaws[-1] + yaw), yaw]
    width = size_window(plan, rate_hz, 0.16)
    knots = np.array(places)
    xy = np.stack([smooth(np.interp(t, times, knots[:, k]), width) for k in (0, 1)], axis=-1)
    heading = smooth(np.interp(t, times, np.array(yaws)), width)
    c, s = walker.forward_wave_m
    wave = amplitude * (c * np.cos(4.0 * np.pi * phase) + s * np.sin(4.0 * np.pi * phase))
    return xy + wave[:, None] * np.stack((np.cos(heading), np.sin(heading)), axis=-1), heading


def orient_pelvis(
    walker: Walker, heading: Floats, phase: Floats, phases: Mapping[Side, Floats], amplitude: Floats
) -> Floats:
    """Pelvis quaternions (n, 4): rotation, then obliquity, then tilt (Baker 2001).

    Parameters
    ----------
    phase : (n,) of the body. phases : side → (n,) of that leg, for pelvic hiking.
    """
    yaw = heading + amplitude * (walker.rotation_factor * PELVIS_ROTATION(phase))
    right_up = walker.obliquity_factor * PELVIS_OBLIQUITY(phase)
    for side, gait in walker.sides.items():
        if gait.hike_rad:
            right_up = right_up + SIGN[side] * gait.hike_rad * phase_bump(phases[side], 0.80, 0.26)
    obliquity = -amplitude * right_up
    tilt = PELVIS_TILT.mean + walker.tilt_rad + amplitude * (PELVIS_TILT(phase) - PELVIS_TILT.mean)
    turned = multiply(about(2, yaw), Q_NEUTRAL)
    return multiply(multiply(turned, about(0, obliquity)), about(2, -tilt))


def load_share(t: Floats, plan: Plan, timings: Mapping[Side, FootTiming], side: Side) -> Floats:
    """Fraction (n,) of body weight on one leg, 0 to 1: shifts in double support, one half in standing."""
    swings = dict.fromkeys(SIDES, 0)
    shifts: list[tuple[float, float, float]] = []
    for step in plan.steps:
        release = float(timings[step.side].release[swings[step.side]])
        swings[step.side] += 1
        lead = 0.25 if step.opens else 0.5 * (release - step.start_s) + 0.1 * step.step_s
        shifts.append((step.start_s - lead, release, 0.0 if step.side == side else 1.0))
        if step.closes:
            shifts.append((step.time_s, step.time_s + 0.35, 0.5))
    share, jumps, now = np.zeros(len(t)), np.zeros(len(t) + 1), 0.5
    for start, end, next_share in shifts:
        i, j = np.searchsorted(t, (start, end))
        share[i:j] += (next_share - now) * smoothstep((t[i:j] - start) / (end - start))
        jumps[j] += next_share - now
        now = next_share
    return 0.5 + share + np.cumsum(jumps[:-1])


def compute_pelvis_height(
    plan: Plan,
    walker: Walker,
    phases: Mapping[Side, Floats],
    amplitude: Floats,
    shares: Mapping[Side, Floats],
    xy: Floats,
    q: Floats,
    ankles: Mapping[Side, Floats],
    rate_hz: float,
) -> Floats:
    """Mid-hip height (n,) in m at which the loaded leg has its target knee flexion."""
    total = np.zeros(len(q))
    for side in SIDES:
        standing_rad, gait = walker.standing_knee_rad, walker.sides[side]
        target = standing_rad + amplitude * (knee_flexion(gait, phases[side]) - standing_rad)
        knee = smooth_max(target, gait.knee_min_rad, DEGREE)
        reach = leg_reach(walker.anatomy, smooth(knee, size_window(plan, rate_hz, 0.02)))
        total += shares[side] * _hip_height(walker, side, xy, q, ankles[side], reach)
    return smooth(total, size_window(plan, rate_hz, 0.01))


def guard(
    z: Floats,
    walker: Walker,
    xy: Floats,
    q: Floats,
    ankles: Mapping[Side, Floats],
    loaded: Mapping[Side, Bools],
    rate_hz: float,
) -> tuple[Floats, float]:
    """Lower the pelvis (n,) where a leg would be overstretched; also returns the largest lowering required
    in m.
    """
    excess = np.zeros(len(z))
    for side in SIDES:
        reach = leg_reach(walker.anatomy, walker.sides[side].knee_min_rad - 0.5 * DEGREE)
        limit = _hip_height(walker, side, xy, q, ankles[side], reach)
        excess = np.maximum(excess, np.where(loaded[side], z - limit, 0.0))
    worst = float(excess.max())
    if worst <= 0.0:
        return z, 0.0
    half = int(GUARD_S * rate_hz) // 2
    # the four running means together are no wider than the maximum filter: the need is met everywhere
    passes = max(1, (half // 2 - 1) | 1)
    return z - smooth(maximum_filter1d(excess, 2 * half + 3, mode="nearest"), passes), worst


def _hip_height(walker: Walker, side: Side, xy: Floats, q: Floats, ankle: Floats, reach: Floats) -> Floats:
    """Mid-hip height (n,) at which hip and ankle are `reach` apart."""
    hip = rotate(q, hip_offset(walker, side))
    apart = xy + hip[:, :2] - ankle[:, :2]
    # far behind (a foot that is not loaded) the root is held real; its load share is zero there
    least = (0.53 * (walker.anatomy.thigh + walker.anatomy.shank)) ** 2
    drop = np.sqrt(np.maximum(reach**2 - np.sum(apart**2, axis=1), least))
    return np.asarray(ankle[:, 2] - hip[:, 2] + drop)
