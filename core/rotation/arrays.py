"""Quaternions and rotation matrices on (..., 4) and (..., 3, 3) arrays, in numpy.

Conventions and sources: `core/rotation/__init__.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.signals.held_samples import AT_A_TIME, cut_blocks

_SMALL = 1e-8

Angle = TypeVar("Angle", float, Floats)


def find_squares(v: Floats) -> Floats:
    """Squared lengths (...) of vectors (..., k), as an explicit sum for three components; np.sum takes six
    times as long.
    """
    first, *more = _components(v)
    total = first * first
    for x in more:
        total = total + x * x
    return np.asarray(total)


def find_lengths(v: Floats) -> Floats:
    """Lengths (...) of vectors (..., k), bit-identical to `np.linalg.norm`."""
    return np.asarray(np.sqrt(find_squares(v)))


def normalise(q: Floats) -> Floats:
    """Scale quaternions (..., 4) to unit norm."""
    return np.asarray(q / find_lengths(q)[..., None])


def multiply(p: Floats, q: Floats) -> Floats:
    """Hamilton product p ⊗ q of (..., 4) arrays, broadcasting."""
    p, q = np.asarray(p, np.float64), np.asarray(q, np.float64)
    if _are_long(p, q):
        return _by_rows(multiply, 4, p, q)
    pw, px, py, pz = _components(p)
    qw, qx, qy, qz = _components(q)
    return np.stack(
        (
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ),
        axis=-1,
    )


def conjugate(q: Floats) -> Floats:
    """Inverse rotation of unit quaternions (..., 4)."""
    return np.asarray(np.asarray(q, np.float64) * np.array([1.0, -1.0, -1.0, -1.0]))


def rotate(q: Floats, v: Floats) -> Floats:
    """Rotate vectors (..., 3) by unit quaternions (..., 4), broadcasting."""
    q, v = np.asarray(q, np.float64), np.asarray(v)
    if _are_long(q, v):
        return _by_rows(rotate, 3, q, v)
    u, w = q[..., 1:], q[..., :1]
    t = 2.0 * _cross(u, v)
    return np.asarray(v + w * t + _cross(u, t))


def find_vertical(q: Floats) -> Floats:
    """World z axis in body frames (n, 3), from q (n, 4); bit-identical to `rotate`."""
    w, x, y, z = _components(np.asarray(q, np.float64))
    a, b = -2.0 * y, 2.0 * x
    return np.stack((0.0 + w * a + z * b, 0.0 + w * b - z * a, 1.0 + (y * a - x * b)), axis=-1)


def to_matrix(q: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = _components(np.asarray(q, np.float64))
    rows = (
        np.stack((1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)), axis=-1),
        np.stack((2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)), axis=-1),
        np.stack((2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)), axis=-1),
    )
    return np.stack(rows, axis=-2)


def from_matrix(R: Floats) -> Floats:
    """Unit quaternions (..., 4), w ≥ 0, of rotation matrices (..., 3, 3).

    Shepperd's choice of the largest of the four components keeps full precision for every angle.
    """
    R = np.asarray(R, np.float64)
    d0, d1, d2 = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    squares = np.stack((1 + d0 + d1 + d2, 1 + d0 - d1 - d2, 1 - d0 + d1 - d2, 1 - d0 - d1 + d2), axis=-1)
    a, b, c = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    d, e, f = R[..., 1, 0] + R[..., 0, 1], R[..., 0, 2] + R[..., 2, 0], R[..., 2, 1] + R[..., 1, 2]
    candidates = np.stack(
        (
            np.stack((squares[..., 0], a, b, c), axis=-1),
            np.stack((a, squares[..., 1], d, e), axis=-1),
            np.stack((b, d, squares[..., 2], f), axis=-1),
            np.stack((c, e, f, squares[..., 3]), axis=-1),
        ),
        axis=-2,
    )
    largest = np.argmax(squares, axis=-1)[..., None, None]
    q = normalise(np.take_along_axis(candidates, largest, axis=-2)[..., 0, :])
    return np.where(q[..., :1] < 0, -q, q)


def exp(phi: Floats) -> Floats:
    """Unit quaternions (..., 4) of rotation vectors (..., 3) in rad."""
    phi = np.asarray(phi, np.float64)
    angle = find_lengths(phi)[..., None]
    half = 0.5 * angle
    scale = np.where(
        angle < _SMALL, 0.5 - angle**2 / 48.0, np.sin(half) / np.where(angle < _SMALL, 1.0, angle)
    )
    return np.concatenate((np.cos(half), scale * phi), axis=-1)


def log(q: Floats) -> Floats:
    """Rotation vectors (..., 3) in rad, norm ≤ π, of unit quaternions (..., 4)."""
    q = np.asarray(q, np.float64)
    q = np.where(q[..., :1] < 0, -q, q)
    v = q[..., 1:]
    sine = find_lengths(v)[..., None]
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    return v * np.where(sine < _SMALL, 2.0, angle / np.where(sine < _SMALL, 1.0, sine))


def angle_between(p: Floats, q: Floats) -> Floats:
    """Angle in rad, [0, π], between orientations (..., 4) (thesis Eq 51, stable near 0)."""
    return find_lengths(log(multiply(conjugate(p), q)))


def mean(q: Floats, weights: Floats | None = None) -> Floats:
    """Mean orientation (4,) of unit quaternions (n, 4): the eigenvector of Markley et al. 2007, eq 12–13."""
    q = np.asarray(q, np.float64)
    w = np.ones(len(q)) if weights is None else np.asarray(weights, np.float64)
    m = np.asarray(np.linalg.eigh((q * w[:, None]).T @ q)[1][:, -1])
    return -m if m[0] < 0 else m


def find_middle(p: Floats, q: Floats) -> Floats:
    """Unit quaternions (n, 4) half way from p to q, both (n, 4), along the shorter arc."""
    total = p + np.where(np.einsum("ni,ni->n", p, q) < 0.0, -1.0, 1.0)[:, None] * q
    return np.asarray(total / np.sqrt(np.einsum("ni,ni->n", total, total))[:, None])


def about(axis: int, angle: Floats | float) -> Floats:
    """Unit quaternions (..., 4) of rotations by `angle` (...) rad about coordinate axis 0, 1 or 2."""
    angle = np.asarray(angle, np.float64)
    q = np.zeros((*angle.shape, 4))
    q[..., 0] = np.cos(angle / 2)
    q[..., 1 + axis] = np.sin(angle / 2)
    return q


def yaw(q: Floats) -> Floats:
    """Heading (...) in rad of the body's x axis in the horizontal plane of the world, from x towards y."""
    x = rotate(q, np.array([1.0, 0.0, 0.0]))
    return np.asarray(np.arctan2(x[..., 1], x[..., 0]))


def split_heading(q: Floats) -> tuple[Floats, Floats]:
    """Decompose rotations (..., 4) into a turn about the vertical followed by a tilt about a horizontal axis.

    Returns
    -------
    The tilt (..., 2), a rotation vector in the horizontal plane, and the turn (...), rad in [−π, π].
    """
    q = np.where(q[..., :1] < 0.0, -q, q)
    turn = 2.0 * np.arctan2(q[..., 3], q[..., 0])
    return log(multiply(q, about(2, -turn)))[..., :2], np.asarray(turn)


def wrap_angle(angle: Angle) -> Angle:
    """Wrap angles (...) in rad to [−π, π)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _are_long(a: Floats, b: Floats) -> bool:
    """Whether one of the two arrays is (n, k) with many rows, and none has more axes."""
    return max(a.size, b.size) > 4 * AT_A_TIME and max(a.ndim, b.ndim) == 2


def _by_rows(function: Callable[[Floats, Floats], Floats], width: int, a: Floats, b: Floats) -> Floats:
    """Apply a function row-wise to a and b, (n, k) or the same for all rows, block by block.

    Temporary arrays then fit into the processor's cache.
    """
    result = np.empty((max(len(x) for x in (a, b) if x.ndim == 2), width))
    for part in cut_blocks(len(result)):
        result[part] = function(*(x[part] if x.ndim == 2 and len(x) == len(result) else x for x in (a, b)))
    return result


def _components(x: Floats) -> tuple[Floats, ...]:
    """Views of the last axis; np.moveaxis takes longer than the arithmetic of a single quaternion."""
    return tuple(x[..., k] for k in range(x.shape[-1]))


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product, broadcasting; the sums written out, ten times faster than np.cross for a single
    vector.
    """
    ax, ay, az = _components(a)
    bx, b_y, bz = _components(b)
    return np.stack((ay * bz - az * b_y, az * bx - ax * bz, ax * b_y - ay * bx), axis=-1)
