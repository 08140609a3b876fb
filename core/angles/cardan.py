"""Angles of single orientations in numpy, for readers of poses; whole signals use `AngleKernel`."""

from __future__ import annotations

from typing import Final

import numpy as np

from sagittal.core.frames import R_NEUTRAL, Floats, Oriented, Segment
from sagittal.core.rotation import conjugate, from_matrix, multiply, rotate, to_matrix
from sagittal.core.signals.held_samples import cut_blocks

COURSE_AXES: Final[dict[Segment, tuple[float, float, float]]] = {
    "pelvis": (0.0, 0.0, 1.0),
    "foot_l": (1.0, 0.0, 0.0),
    "foot_r": (1.0, 0.0, 0.0),
}
"""Segment → the axis whose direction over the floor is its course: the pelvis's right, a foot's front."""


def cardan_zxy(q: Floats) -> Floats:
    """Angles (..., 3) = (a, b, c) in rad of q (..., 4) = Rz(a) Rx(b) Ry(c)
    (docs/science/joint-angles.md, "Joints")."""
    R = to_matrix(q)
    a = np.arctan2(-R[..., 0, 1], R[..., 1, 1])
    b = np.arcsin(np.clip(R[..., 2, 1], -1.0, 1.0))
    c = np.arctan2(-R[..., 2, 0], R[..., 2, 2])
    return np.stack((a, b, c), axis=-1)


def pelvis_angles(q: Floats) -> tuple[Floats, Floats]:
    """Anterior tilt and obliquity (right side up) in rad of the pelvis q (..., 4) in W (Baker 2001)."""
    R = to_matrix(multiply(conjugate(from_matrix(R_NEUTRAL)), q))
    tilt = -np.arctan2(R[..., 1, 0], R[..., 1, 1])
    obliquity = -np.arcsin(np.clip(-R[..., 1, 2], -1.0, 1.0))
    return np.asarray(tilt), np.asarray(obliquity)


def compute_headings(orientations: Oriented) -> dict[str, Floats]:
    """Headings of pelvis and feet about the vertical, as `JointAngles.headings`; NaN where lost.

    The pelvis heading is that of its medio-lateral axis, as in the decomposition above; a foot heading that
    of the foot's medio-lateral axis.
    """
    headings: dict[str, Floats] = {}
    for segment, axis in COURSE_AXES.items():
        if segment not in orientations.q:
            continue
        ok = orientations.valid[segment]
        course = np.full(len(ok), np.nan)
        for part in cut_blocks(len(ok)):
            x, y, _ = rotate(orientations.q[segment][part], np.array(axis)).T
            course[part] = np.arctan2(y, x)
        course[ok], course[~ok] = np.unwrap(course[ok]), np.nan
        headings[segment] = course
    return headings
