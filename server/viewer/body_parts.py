"""Procedural body parts: tables of cross-sections, lofted into one closed mesh per part.

Every part belongs to one rigid segment and uses its axes: x forward, y up, z to the right, in m.
Origins: thigh at the hip centre, shank at the knee centre, foot at the ankle centre, toes at their
bend, others midway between the hip centres. Joints remain closed at any angle because both segments end
in domes about the joint centre.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from math import atan2, hypot
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sagittal.core.body.model import HIP_FRACTION, THIGH_FRACTION, BodyModel
from sagittal.core.frames import Floats
from sagittal.server.viewer import profiles
from sagittal.server.viewer.shapes import Mesh, interpolate_rows, join_meshes, loft_sections

PartName = Literal[
    "thighs", "shanks", "foot_l", "foot_r", "toes_l", "toes_r", "pelvis", "trunk", "rings", "arms"
]

_BALL: Final = 0.45
"""Position of the toe bend, in foot lengths anterior to the ankle."""

_KNUCKLE: Final = 0.27
"""Half the thickness of the foot there, in ankle heights."""

_TIP: Final = 0.75
"""End of the toes, in foot lengths anterior to the ankle."""

_MOST_BEND: Final = np.deg2rad(65.0)

_ARMS_OUT: Final = np.deg2rad(7.0)
_ELBOWS: Final = np.deg2rad(16.0)


@lru_cache(maxsize=32)
def make_parts(body: BodyModel) -> Mapping[PartName, Mesh]:
    """Return all meshes of a body; thighs and shanks are shared by both sides, feet and toes are not."""
    return {
        "thighs": make_limb(profiles.THIGH, body.thigh, body, 13),
        "shanks": make_limb(profiles.SHANK, body.shank, body, 14),
        "foot_l": make_foot(body, -1),
        "foot_r": make_foot(body, 1),
        "pelvis": make_pelvis(body),
        "trunk": make_trunk(body),
        "toes_l": make_toes(body, -1),
        "toes_r": make_toes(body, 1),
        "rings": join_meshes(*(make_ring(body, start, start + 0.05) for start in (0.34, 0.45))),
        "arms": make_arms(body),
    }


def make_limb(table: Floats, length: float, body: BodyModel, rings: int) -> Mesh:
    """Return a thigh or shank of `length` m, hanging from the origin, with domes about both joints."""
    rows = _hang(interpolate_rows(table, rings), length, body)
    return loft_sections(rows, 20, (float(rows[0, 2:4].mean()), float(rows[-1, 2:4].mean())))


def make_ring(body: BodyModel, start: float, end: float, lift: float = 0.0012) -> Mesh:
    """Return a ring around the shank from `start` to `end` of its length, `lift` m off the skin."""
    rows = _hang(interpolate_rows(profiles.SHANK, 4, (start, end)), body.shank, body)
    rows[:, 2:] += lift
    return loft_sections(rows, 20)


def make_foot(body: BodyModel, side: int) -> Mesh:
    """Return a foot (side: 1 right, −1 left) from heel to ball; the flat of its sole is at −ankle height."""
    r = _stature(body) / 1000
    # the shank rotates in a dome about the ankle centre
    u = np.linspace(-np.pi / 2, np.pi / 2, 8)[1:-1]
    widths = np.cos(u)[:, None] * (np.array([17.6, 17.6, 18.2]) * r)
    dome = loft_sections(np.column_stack((17.6 * r * np.sin(u), 0 * u, widths)), 12, (2.0 * r, 2.0 * r))
    return join_meshes(_loft_foot(body, side, (-250.0, 1000 * _BALL), 14), dome)


def make_toes(body: BodyModel, side: int) -> Mesh:
    """Return the forefoot, in the axes of the foot about the ball."""
    v, f = _loft_foot(body, side, (1000 * _BALL, 1000 * _TIP), 9)
    return (v - locate_ball(body)).astype(np.float32), f


def locate_ball(body: BodyModel) -> Floats:
    """Return the position of the toe bend, (3,) m in the axes of the foot."""
    return np.array([_BALL * body.foot, (_KNUCKLE - 1.0) * body.ankle_height, 0.0])


def find_toe_bend(body: BodyModel, pitch: Floats, height: Floats) -> Floats:
    """Return the smallest upward bend of the toes, rad, that keeps their tip above the floor.

    It is not measured but caused by the floor. A rigid foot would sink in by up to 6 cm at push-off.

    Parameters
    ----------
    pitch : of the foot, rad, toes up. height : of the ball above the floor, m.
    """
    along, under = (_TIP - _BALL - 0.05) * body.foot, _KNUCKLE * body.ankle_height
    # for a single frame np.clip alone would take as long as everything else
    low = np.minimum(np.maximum(height / hypot(along, under), -1.0), 1.0)
    least = atan2(under, along) - np.arcsin(low) - pitch
    return np.asarray(np.minimum(np.maximum(least, 0.0), _MOST_BEND))


def make_pelvis(body: BodyModel) -> Mesh:
    """Return the pelvis, with a width that matches the hip centres."""
    r = _stature(body) / 1000
    rows = interpolate_rows(profiles.PELVIS, 13) * r
    rows[:, 4:] *= body.hip_width / (HIP_FRACTION * _stature(body))
    return loft_sections(rows, 24, (8 * r, 14 * r), power=(2.6, 2.2))


def make_trunk(body: BodyModel) -> Mesh:
    """Return trunk, neck and head in one mesh."""
    r = _stature(body) / 1000
    torso = loft_sections(interpolate_rows(profiles.TRUNK, 22) * r, 24, (10 * r, 6 * r), power=(2.35, 2.35))
    rows = interpolate_rows(profiles.HEAD, 15, dense_ends=True) * r
    return join_meshes(torso, loft_sections(rows, 22, (3 * r, 0.4 * r), power=(2.1, 2.1)))


def make_arms(body: BodyModel) -> Mesh:
    """Return both arms hanging at rest; they are not measured and do not move relative to the trunk."""
    r = _stature(body) / 1000
    table = profiles.ARM * r
    table[:, 0] *= -1.0
    v, f = loft_sections(interpolate_rows(table[::-1], 17), 12, (9 * r, 20 * r))
    hanging = _bend_forward(v, lambda y: _ELBOWS * _rise((-y / r - 150.0) / 70.0) - np.deg2rad(4.0))
    meshes = []
    for side in (-1, 1):
        c, s = np.cos(_ARMS_OUT), side * np.sin(_ARMS_OUT)
        turn = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
        meshes.append((hanging @ turn.T + np.array(profiles.SHOULDER) * [r, r, side * r], f))
    return join_meshes(*meshes)


def _stature(body: BodyModel) -> float:
    """Body height, m, estimated from the thigh length, which may have been measured."""
    return body.thigh / THIGH_FRACTION


def _hang(rows: Floats, length: float, body: BodyModel) -> Floats:
    """Rows of a limb's table, in m, from its lower end upwards."""
    return np.column_stack((-length * rows[:, 0], rows[:, 1:] * _stature(body) / 1000))[::-1]


def _loft_foot(body: BodyModel, side: int, bounds: tuple[float, float], rings: int) -> Mesh:
    scale = np.array([body.foot, body.ankle_height, body.ankle_height, body.foot, body.foot]) / 1000
    x, top, bottom, out, inn = (interpolate_rows(profiles.FOOT, rings, bounds, dense_ends=True) * scale).T
    half = (top - bottom) / 2
    sides = (out, inn) if side > 0 else (inn, out)
    knuckle = _KNUCKLE * body.ankle_height
    caps = (0.0, knuckle) if bounds[0] < 0 else (knuckle, 0.0)
    # sections are perpendicular to x: forward in a loft is up here; squarer below, for a flat sole
    sections = np.stack((x, (top + bottom) / 2, half, half, *sides), axis=1)
    v, f = loft_sections(sections, 18, caps, power=(2.0, 4.5))
    v = v[:, [1, 0, 2]].astype(np.float64)
    under = np.clip((-0.55 * body.ankle_height - v[:, 1]) / (0.45 * body.ankle_height), 0.0, 1.0)
    inner = np.clip(0.45 - side * v[:, 2] / (0.13 * body.foot), 0.0, 1.0)
    arch = np.exp(-(((v[:, 0] / body.foot - 0.16) / 0.13) ** 2))
    v[:, 1] += 0.26 * body.ankle_height * under * inner * arch
    return v.astype(np.float32), f[:, ::-1]


def _bend_forward(v: NDArray[np.float32], angle: Callable[[Floats], Floats]) -> Floats:
    """Bend a hanging part about z: at height y < 0 its axis leans forward by `angle(y)`, rad."""
    down = np.linspace(0.0, -float(v[:, 1].min()), 200)
    lean, step = angle(-down), np.diff(down, prepend=0.0)
    y = np.minimum(v[:, 1], 0.0).astype(np.float64)
    x0, y0 = (np.interp(-y, down, np.cumsum(g * step)) for g in (np.sin(lean), -np.cos(lean)))
    c, s, over = np.cos(angle(y)), np.sin(angle(y)), v[:, 1] - y
    return np.stack((x0 + c * v[:, 0] - s * over, y0 + s * v[:, 0] + c * over, v[:, 2]), axis=1)


def _rise(x: Floats) -> Floats:
    """Smooth step from 0 to 1."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
