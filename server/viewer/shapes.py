"""The few meshes the figure is made of, each drawn many times: bone, letter, ball, shoe, footprint.

All are (vertices (n, 3) float32, faces (m, 3) uint32), outward facing, made once at import of the viewer.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from core.frames import Side

Mesh = tuple[NDArray[np.float32], NDArray[np.uint32]]


TIP = 0.74
"""Radius of a bone at its end, relative to its base."""

_STROKE = 0.16
_STROKES: dict[Side, list[list[tuple[float, float]]]] = {
    "left": [[(-0.16, 0.92), (-0.16, 0.08), (0.18, 0.08)]],
    "right": [
        [(-0.17, 0.08), (-0.17, 0.92), (0.03, 0.92), (0.13, 0.87), (0.17, 0.7), (0.13, 0.54), (0.03, 0.48)],
        [(-0.17, 0.48), (0.03, 0.48)],
        [(0.0, 0.48), (0.17, 0.08)],
    ],
}
"""The letters L and R as lines, 1 high with the stroke, their feet at 0."""


def make_bone(sides: int = 28, tip: float = TIP, cap: float = 0.09) -> Mesh:
    """Return a rounded cone along +z from 0 to 1: radius 1 at the base, `tip` at the end, caps `cap` long."""
    u = np.linspace(0.0, np.pi / 2, 7)
    base = [(np.sin(a), -cap * np.cos(a)) for a in u]
    end = [(tip * np.cos(a), 1.0 + cap * tip * np.sin(a)) for a in u]
    return _turned(base + end, sides)


def make_letter(
    side: Side, radius: float, length: float, height: float, turn: float = 0.0, copies: int = 4
) -> Mesh:
    """Return the letter L or R, several times around a bone of `radius` and `length` m, its feet at the end.

    One of the copies faces whoever looks at the bone, the first one where it is looked at from `turn` rad
    about its axis, 0 along x.
    """
    quads = np.concatenate([_stroke(line) for line in _STROKES[side]]) * height
    along = 0.5 * (length - height) + height - quads[..., 1]
    r = radius * (1.0 - (1.0 - TIP) * along / length)
    vertices = []
    for k in range(copies):
        a = turn + 2 * np.pi * k / copies - quads[..., 0] / r
        vertices.append(np.stack((r * np.cos(a), r * np.sin(a), along), axis=-1).reshape(-1, 3))
    first = 4 * np.arange(copies * len(quads))[:, None]
    faces = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    return np.concatenate(vertices).astype(np.float32), faces.astype(np.uint32)


def _stroke(line: Sequence[tuple[float, float]], step: float = 0.1) -> NDArray[np.float64]:
    """Quads (n, 4, 2) along a line, counter-clockwise, short enough to be bent around a bone."""
    quads = []
    for start, end in pairwise(np.array(line)):
        way = (end - start) / np.linalg.norm(end - start)
        across = 0.5 * _STROKE * np.array([way[1], -way[0]])
        over = 0.5 * _STROKE * way  # square ends close the corners
        count = max(1, round(float(np.linalg.norm(end - start)) / step)) + 1
        points = np.linspace(start - over, end + over, count + 1)
        quads += [np.stack((a + across, b + across, b - across, a - across)) for a, b in pairwise(points)]
    return np.array(quads)


def make_ball(rings: int = 14, sides: int = 28) -> Mesh:
    """Return a sphere of radius 1; scaled per axis it is the pelvis."""
    u = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    return _turned([(np.cos(a), np.sin(a)) for a in u], sides)


def make_footprint(length: float, side: Side, points: int = 48) -> Mesh:
    """Return the outline of a flat sole facing +z: x to the toes, z = 0, origin in the middle of its length.

    Narrow at the arch on the inner side, the toes drawn inwards; proportions are for the eye only.
    """
    s = -np.cos(np.linspace(0.0, np.pi, points))
    half = (0.155 + 0.025 * s) * np.sqrt(1.0 - s**4)
    arch = np.exp(-(((s + 0.1) / 0.32) ** 2))
    inwards = 0.02 * s + 0.02 * s**2
    outer, inner = half * (1.0 - 0.12 * arch) - inwards, half * (1.0 - 0.5 * arch) + inwards
    left, right = (inner, outer) if side == "right" else (outer, inner)
    edges = [np.stack((0.5 * s, y, 0.0 * s), axis=1) for y in (left, -right)]
    vertices = length * np.concatenate(edges)
    i = np.arange(points - 1)
    faces = np.concatenate(
        (np.stack((i, points + i, points + i + 1), axis=1), np.stack((i, points + i + 1, i + 1), axis=1))
    )
    return vertices.astype(np.float32), faces.astype(np.uint32)


def make_shoe(length: float, ankle_height: float, sides: int = 24) -> Mesh:
    """Return a shoe in foot axes (x forward, y up, z right), origin at the ankle, sole at −`ankle_height`.

    The heel lies a quarter of the length behind the ankle; the ratio is for the eye only.
    """
    x = np.array([-0.25, -0.245, -0.22, -0.15, -0.02, 0.15, 0.35, 0.52, 0.65, 0.725, 0.75]) * length
    half_width = np.array([0.02, 0.07, 0.105, 0.13, 0.135, 0.14, 0.17, 0.17, 0.13, 0.07, 0.02]) * length
    top = np.array([-0.35, -0.15, 0.05, 0.18, 0.2, 0.0, -0.3, -0.5, -0.62, -0.72, -0.85]) * ankle_height
    bottom = np.full_like(x, -ankle_height)
    bottom[[0, -1]] += 0.12 * ankle_height
    a = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    # a superellipse keeps the sole flat and the instep round
    round_y, round_z = (
        np.sign(np.sin(a)) * np.abs(np.sin(a)) ** 0.6,
        np.sign(np.cos(a)) * np.abs(np.cos(a)) ** 0.8,
    )
    middle, half_height = (top + bottom) / 2, (top - bottom) / 2
    vertices = np.stack(
        (
            np.repeat(x[:, None], sides, 1),
            middle[:, None] + half_height[:, None] * round_y,
            half_width[:, None] * round_z,
        ),
        axis=-1,
    ).reshape(-1, 3)
    ends = np.stack(([x[0], middle[0], 0.0], [x[-1], middle[-1], 0.0]))
    faces = _grid_faces(len(x), sides)
    n, last = len(vertices), len(vertices) - sides
    j = np.arange(sides)
    heel = np.stack((np.full(sides, n), (j + 1) % sides, j), axis=1)
    toe = np.stack((np.full(sides, n + 1), last + j, last + (j + 1) % sides), axis=1)
    return np.concatenate((vertices, ends)).astype(np.float32), np.concatenate((faces, heel, toe)).astype(
        np.uint32
    )


def _turned(profile: Sequence[tuple[float, float]], sides: int) -> Mesh:
    """Surface of revolution about z of (radius, z) points given from bottom to top."""
    r, z = np.array(profile, dtype=np.float64).T
    a = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    vertices = np.stack(
        (r[:, None] * np.cos(a), r[:, None] * np.sin(a), np.repeat(z[:, None], sides, 1)), axis=-1
    )
    faces = _grid_faces(len(r), sides)[:, ::-1]
    return vertices.reshape(-1, 3).astype(np.float32), faces.astype(np.uint32)


def _grid_faces(rings: int, sides: int) -> NDArray[np.int64]:
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij"))
    a, b = i * sides + j, i * sides + (j + 1) % sides
    lower = np.stack((a, a + sides, b), axis=1)
    upper = np.stack((b, a + sides, b + sides), axis=1)
    return np.concatenate((lower, upper))
