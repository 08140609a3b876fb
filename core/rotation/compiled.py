"""Rotations inside compiled loops: one quaternion (4,) or matrix (3, 3) at a time, no allocation.

Array results are written to the last argument, which must not alias the others; scalars are returned.
Compiled without reference counting of arrays (`_nrt`), which would cost more than most of these functions.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numba
import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.signals.inner import UNCOUNTED, inner_njit

SMALL = 1e-8
"""Below this angle in rad the series of one term replaces the sine."""

SERIES = 1e-4
"""Angle in rad below which series of three terms are exact to 1e-16."""


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def wrap_angle(angle):  # type: ignore[no-untyped-def]
    """Wrap an angle in rad to [−π, π)."""
    return (angle + pi) % (2.0 * pi) - pi


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def multiply(pw, px, py, pz, qw, qx, qy, qz):  # type: ignore[no-untyped-def]
    """Components (w, x, y, z) of the Hamilton product p ⊗ q."""
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def to_matrix(q, R):  # type: ignore[no-untyped-def]
    """Write the matrix R (3, 3) of a unit quaternion q (4,)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[0, 1] = 2.0 * (x * y - w * z)
    R[0, 2] = 2.0 * (x * z + w * y)
    R[1, 0] = 2.0 * (x * y + w * z)
    R[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[1, 2] = 2.0 * (y * z - w * x)
    R[2, 0] = 2.0 * (x * z - w * y)
    R[2, 1] = 2.0 * (y * z + w * x)
    R[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def from_matrix(R, q):  # type: ignore[no-untyped-def]
    """Write the unit quaternion q (4,), w ≥ 0, of a matrix R (3, 3), by its largest component."""
    a, b, c = R[0, 0], R[1, 1], R[2, 2]
    squares = (1 + a + b + c, 1 + a - b - c, 1 - a + b - c, 1 - a - b + c)
    best = 0
    for i in range(1, 4):
        if squares[i] > squares[best]:
            best = i
    x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    d, e, f = R[1, 0] + R[0, 1], R[0, 2] + R[2, 0], R[2, 1] + R[1, 2]
    if best == 0:
        q[0], q[1], q[2], q[3] = squares[0], x, y, z
    elif best == 1:
        q[0], q[1], q[2], q[3] = x, squares[1], d, e
    elif best == 2:
        q[0], q[1], q[2], q[3] = y, d, squares[2], f
    else:
        q[0], q[1], q[2], q[3] = z, e, f, squares[3]
    length = sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    if q[0] < 0.0:
        length = -length
    for i in range(4):
        q[i] /= length


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def transform(R, v, out):  # type: ignore[no-untyped-def]
    """Write R v (3,) of a matrix (3, 3) and a vector (3,)."""
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def cross(a, b, out):  # type: ignore[no-untyped-def]
    """Write the cross product a × b (3,)."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def turn(q, a, b, c):  # type: ignore[no-untyped-def]
    """Turn q (4,) in place by the rotation vector (a, b, c), rad: q ← q ⊗ Exp((a, b, c)), normalised."""
    angle = sqrt(a * a + b * b + c * c)
    k = 0.5 - angle * angle / 48.0 if angle < SMALL else sin(0.5 * angle) / angle
    w, i, j, k = multiply(q[0], q[1], q[2], q[3], cos(0.5 * angle), k * a, k * b, k * c)
    s = 1.0 / sqrt(w * w + i * i + j * j + k * k)
    q[0], q[1], q[2], q[3] = w * s, i * s, j * s, k * s


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def skew(a: Floats, out: Floats) -> None:
    """Write [a]× (3, 3)."""
    out[0, 0], out[0, 1], out[0, 2] = 0.0, -a[2], a[1]
    out[1, 0], out[1, 1], out[1, 2] = a[2], 0.0, -a[0]
    out[2, 0], out[2, 1], out[2, 2] = -a[1], a[0], 0.0


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def times_cross(M, r, k, out):  # type: ignore[no-untyped-def]
    """Write k M [r]× (3, 3) of a matrix M (3, 3), a vector r (3,) and a factor k."""
    for i in range(3):
        x, y, z = k * M[i, 0], k * M[i, 1], k * M[i, 2]
        out[i, 0] = y * r[2] - z * r[1]
        out[i, 1] = z * r[0] - x * r[2]
        out[i, 2] = x * r[1] - y * r[0]


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def skew_polynomial(phi, k, c1, c2, out):  # type: ignore[no-untyped-def]
    """Write k 1 + c1 [φ]× + c2 [φ]×² (3, 3); the exponential and its Jacobians are of this form."""
    x, y, z = phi[0], phi[1], phi[2]
    out[0, 0] = k - c2 * (y * y + z * z)
    out[1, 1] = k - c2 * (x * x + z * z)
    out[2, 2] = k - c2 * (x * x + y * y)
    out[0, 1] = c2 * x * y - c1 * z
    out[1, 0] = c2 * x * y + c1 * z
    out[0, 2] = c2 * x * z + c1 * y
    out[2, 0] = c2 * x * z - c1 * y
    out[1, 2] = c2 * y * z - c1 * x
    out[2, 1] = c2 * y * z + c1 * x


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def multiply3(a: Floats, b: Floats, out: Floats) -> None:
    """Write the product of two matrices (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@inner_njit(**UNCOUNTED)
def sine_quotients(square):  # type: ignore[no-untyped-def]
    """sin θ / θ, (1 − cos θ) / θ² and (θ − sin θ) / θ³ of an angle θ given as its square."""
    if square < SERIES * SERIES:
        first = 1.0 - square / 6.0 + square * square / 120.0
        return first, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    angle = sqrt(square)
    first = sin(angle) / angle
    return first, 2.0 * sin(0.5 * angle) ** 2 / square, (1.0 - first) / square


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def exp_so3(phi: Floats, rotation: Floats, jacobian: Floats) -> None:
    """Write Exp(φ) and the left Jacobian J_l(φ), both (3, 3)."""
    s1, s2, s3 = sine_quotients(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    skew_polynomial(phi, 1.0, s1, s2, rotation)
    skew_polynomial(phi, 1.0, s2, s3, jacobian)


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def log_so3(rotation: Floats, out: Floats) -> None:
    """Write the rotation vector (3,), norm ≤ π, of a matrix, computed from the quaternion's largest
    component.
    """
    d0, d1, d2 = rotation[0, 0], rotation[1, 1], rotation[2, 2]
    a = rotation[2, 1] - rotation[1, 2]
    b = rotation[0, 2] - rotation[2, 0]
    c = rotation[1, 0] - rotation[0, 1]
    d = rotation[0, 1] + rotation[1, 0]
    e = rotation[0, 2] + rotation[2, 0]
    f = rotation[1, 2] + rotation[2, 1]
    w, i, j, k = 1.0 + d0 + d1 + d2, 1.0 + d0 - d1 - d2, 1.0 - d0 + d1 - d2, 1.0 - d0 - d1 + d2
    if w >= i and w >= j and w >= k:
        i, j, k = a, b, c
    elif i >= j and i >= k:
        w, j, k = a, d, e
    elif j >= k:
        w, i, k = b, d, f
    else:
        w, i, j = c, e, f
    if w < 0.0:
        w, i, j, k = -w, -i, -j, -k
    sine = np.sqrt(i * i + j * j + k * k)
    # the common scale of w and (i, j, k) drops out of the arc tangent
    scale = 2.0 / w if sine < 1e-8 * w else 2.0 * np.arctan2(sine, w) / sine
    out[0], out[1], out[2] = scale * i, scale * j, scale * k


@numba.njit(cache=True, nogil=True, **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def orthonormalise(rotation: Floats, work: Floats) -> None:
    """Remove rounding errors from a rotation (3, 3) in place: R ← R (3 − RᵀR) / 2; work is (2, 3, 3)."""
    gram, copy = work[0], work[1]
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += rotation[k, i] * rotation[k, j]
            gram[i, j] = (1.5 if i == j else 0.0) - 0.5 * total
            copy[i, j] = rotation[i, j]
    multiply3(copy, gram, rotation)
