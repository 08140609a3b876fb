"""The few meshes the figure is made of, each drawn many times: bone, ball, shoe, footprint.

All are (vertices (n, 3) float32, faces (m, 3) uint32), outward facing, made once at import of the viewer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.frames import Side

Mesh = tuple[NDArray[np.float32], NDArray[np.uint32]]


def bone(sides: int = 28, tip: float = 0.74, cap: float = 0.09) -> Mesh:
    """Rounded cone along +z from 0 to 1: radius 1 at the base, `tip` at the end, caps `cap` long."""
    u = np.linspace(0.0, np.pi / 2, 7)
    base = [(np.sin(a), -cap * np.cos(a)) for a in u]
    end = [(tip * np.cos(a), 1.0 + cap * tip * np.sin(a)) for a in u]
    return _turned(base + end, sides)


def ball(rings: int = 14, sides: int = 28) -> Mesh:
    """Sphere of radius 1; scaled per axis it is the pelvis."""
    u = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    return _turned([(np.cos(a), np.sin(a)) for a in u], sides)


def footprint(length: float, side: Side, points: int = 48) -> Mesh:
    """Outline of a sole lying flat, facing +z: x to the toes, z = 0, origin in the middle of its length.

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


def shoe(length: float, ankle_height: float, sides: int = 24) -> Mesh:
    """A shoe in foot axes (x forward, y up, z right), origin at the ankle, sole at −`ankle_height`.

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
