"""Smooth closed surfaces through cross-sections, and footprints.

A mesh is (vertices (n, 3) float32, faces (m, 3) uint32), with faces counter-clockwise from outside and
vertices shared between faces for smooth shading.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Floats, Side

Mesh = tuple[NDArray[np.float32], NDArray[np.uint32]]


def loft_sections(
    rows: Floats,
    sides: int,
    caps: tuple[float, float] = (0.0, 0.0),
    power: tuple[float, float] = (2.0, 2.0),
) -> Mesh:
    """Return the closed surface through cross-sections along y, with domed or flat ends.

    Parameters
    ----------
    rows : (n, 5 or 6) m: position in y, increasing, centre in x, extent forward, back, right and left;
        without the last column left equals right. sides : vertices of a section, four quarters of
        superellipses. caps : height of the dome on the lower and on the upper end, m, 0 = flat.
    power : of the front and of the back half, 2 = ellipse.
    """
    rows = np.column_stack((rows, rows[:, 4])) if rows.shape[1] == 5 else rows
    u = np.linspace(0.0, np.pi / 2, 5)[1:-1]
    low, high = (np.repeat(rows[k][None], len(u), 0) for k in (0, -1))
    for dome, tall in ((low, -caps[0]), (high, caps[1])):
        dome[:, 0] += tall * np.sin(u)
        dome[:, 2:] *= np.cos(u)[:, None]
    tips = rows[[0, -1], :2] + np.array([[-caps[0], 0.0], [caps[1], 0.0]])
    rows = np.concatenate((low[::-1] if caps[0] else low[:0], rows, high if caps[1] else high[:0]))
    a = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    e = 2.0 / np.where(np.cos(a) >= 0, *power)
    c, s = (np.sign(g) * np.abs(g) ** e for g in (np.cos(a), np.sin(a)))
    y, x, front, back, right, left = (col[:, None] for col in rows.T)
    xs = x + np.where(c >= 0, front, back) * c, np.where(s >= 0, right, left) * s
    v = np.stack((xs[0], np.broadcast_to(y, xs[1].shape), xs[1]), axis=-1).reshape(-1, 3)
    v = np.concatenate((v, np.column_stack((tips[:, ::-1], np.zeros(2)))))
    j, i = np.arange(sides), np.arange(len(rows) - 1)[:, None] * sides
    p, q, top = (i + j).ravel(), (i + (j + 1) % sides).ravel(), (len(rows) - 1) * sides
    faces = (
        np.stack((p, p + sides, q), axis=1),
        np.stack((q, p + sides, q + sides), axis=1),
        np.stack((j, (j + 1) % sides, np.full(sides, len(v) - 2)), axis=1),
        np.stack((top + (j + 1) % sides, top + j, np.full(sides, len(v) - 1)), axis=1),
    )
    return v.astype(np.float32), np.concatenate(faces).astype(np.uint32)


def interpolate_rows(
    table: Floats, count: int, bounds: tuple[float, float] | None = None, *, dense_ends: bool = False
) -> Floats:
    """Interpolate a table (n, k) at `count` positions of its first column by monotone cubics.

    Source: Fritsch and Butland 1984, doi:10.1137/0905021.

    Parameters
    ----------
    bounds : first and last position, None = the whole table. dense_ends : denser positions towards both
        ends.
    """
    x, y = table[:, 0], table[:, 1:]
    h = np.diff(x)[:, None]
    d = np.diff(y, axis=0) / h
    m = np.concatenate((d[:1], np.zeros_like(d[1:]), d[-1:]))
    rising = d[:-1] * d[1:] > 0
    w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        m[1:-1][rising] = ((w1 + w2) / (w1 / d[:-1] + w2 / d[1:]))[rising]
    u = np.linspace(0.0, 1.0, count)
    low, high = bounds or (x[0], x[-1])
    positions = low + (high - low) * ((1 - np.cos(np.pi * u)) / 2 if dense_ends else u)
    i = np.clip(np.searchsorted(x, positions, side="right") - 1, 0, len(h) - 1)
    s, span = ((positions - x[i]) / h[i, 0])[:, None], h[i]
    value = (1 + 2 * s) * (1 - s) ** 2 * y[i] + s * (1 - s) ** 2 * span * m[i]
    value += s * s * (3 - 2 * s) * y[i + 1] - s * s * (1 - s) * span * m[i + 1]
    return np.column_stack((positions, value))


def join_meshes(*meshes: tuple[NDArray[np.floating], NDArray[np.integer]]) -> Mesh:
    """Merge several closed surfaces into one mesh."""
    start = np.cumsum([0, *(len(v) for v, _ in meshes)])
    faces = [f + k for (_, f), k in zip(meshes, start, strict=False)]
    return np.concatenate([v for v, _ in meshes]).astype(np.float32), np.concatenate(faces).astype(np.uint32)


def make_footprint(length: float, side: Side, points: int = 48) -> Mesh:
    """Return the outline of a flat sole facing +z: x to the toes, z = 0, origin at mid-length.

    Narrow at the medial arch, with toes pointing inwards; proportions are illustrative.
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
