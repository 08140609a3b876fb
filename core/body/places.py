"""Nominal sensor positions in segment axes, used where they are not measured.

Segment frames are those of core/frames.py (x anterior, y up, z to the right), origins of core/body/poses.py.
Source: docs/science/body-model.md, "Places of sensors". Displacements of 2 cm change joint angles by ≤ 0.3°
and strides by ≤ 0.5 cm; 7 cm along the shank or 3 cm up or down the foot change strides by 1 to 4 cm.
"""

from __future__ import annotations

import numpy as np

from sagittal.core.body.model import BodyModel
from sagittal.core.frames import Floats, Segment

PELVIS = (-0.10, 0.08, 0.0)
"""m, over the sacrum, from mid-hip."""

THIGH = (0.06, 0.06)
"""m, forward and outward; half way down the thigh."""

SHANK = (0.03, 0.03)
"""m, forward and outward; 45 % down the shank."""

THIGH_SHARE, SHANK_SHARE = 0.5, 0.45

FOOT = (0.07, -0.03, 0.0)
"""m, on the instep, from the ankle centre."""


def sensor_place(segment: Segment, body: BodyModel) -> Floats:
    """Nominal position (3,) in m of the sensor of a segment in that segment's axes."""
    out = -1.0 if segment.endswith("_l") else 1.0
    if segment.startswith("thigh"):
        return np.array([THIGH[0], -THIGH_SHARE * body.thigh, out * THIGH[1]])
    if segment.startswith("shank"):
        return np.array([SHANK[0], -SHANK_SHARE * body.shank, out * SHANK[1]])
    return np.array(FOOT if segment.startswith("foot") else PELVIS)


def joint_places(body: BodyModel) -> dict[tuple[Segment, Segment], tuple[Floats, Floats]]:
    """(proximal, distal) → the joint's centre (3,) in m in the axes of both segments."""
    centres: dict[tuple[Segment, Segment], tuple[Floats, Floats]] = {}
    chains: tuple[tuple[Segment, Segment, Segment, float], ...] = (
        ("thigh_r", "shank_r", "foot_r", 1.0),
        ("thigh_l", "shank_l", "foot_l", -1.0),
    )
    for thigh, shank, foot, out in chains:
        centres["pelvis", thigh] = np.array([0.0, 0.0, 0.5 * out * body.hip_width]), np.zeros(3)
        centres[thigh, shank] = np.array([0.0, -body.thigh, 0.0]), np.zeros(3)
        centres[shank, foot] = np.array([0.0, -body.shank, 0.0]), np.zeros(3)
    return centres


def standing_origin(segment: Segment, body: BodyModel) -> Floats:
    """Origin (3,) in m of a segment in W in neutral standing, mid-hip above the origin, floor at z = 0."""
    knee = body.ankle_height + body.shank
    hip = knee + body.thigh
    height = {"thigh": hip, "shank": knee, "foot": body.ankle_height}.get(segment[:-2], hip)
    lateral = {"_l": 0.5, "_r": -0.5}.get(segment[-2:], 0.0) * body.hip_width
    return np.array([0.0, lateral, height])
