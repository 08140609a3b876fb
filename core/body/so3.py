"""Rotations inside compiled loops: quaternions and 3 × 3 matrices in place, no allocation."""

from __future__ import annotations

from math import cos, sin, sqrt

import numba

FAST = {"contract", "reassoc", "nsz"}
"""Floating-point licence of the compiled loops: NaN and infinity keep their meaning, so checks still work."""

SMALL = 1e-8
"""Below this angle in rad the series replace sine and cosine."""


@numba.njit(cache=True, nogil=True, fastmath=FAST)  # type: ignore[misc, unused-ignore]
def matrix(q, R):  # type: ignore[no-untyped-def]
    """Write the matrix of a unit quaternion into R."""
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


@numba.njit(cache=True, nogil=True, fastmath=FAST)  # type: ignore[misc, unused-ignore]
def turn(q, a, b, c):  # type: ignore[no-untyped-def]
    """q ← q ⊗ Exp((a, b, c)), normalised."""
    angle = sqrt(a * a + b * b + c * c)
    k = 0.5 - angle * angle / 48.0 if angle < SMALL else sin(0.5 * angle) / angle
    e, x, y, z = cos(0.5 * angle), k * a, k * b, k * c
    w0, x0, y0, z0 = q[0], q[1], q[2], q[3]
    w = w0 * e - x0 * x - y0 * y - z0 * z
    i = w0 * x + x0 * e + y0 * z - z0 * y
    j = w0 * y - x0 * z + y0 * e + z0 * x
    k = w0 * z + x0 * y - y0 * x + z0 * e
    s = 1.0 / sqrt(w * w + i * i + j * j + k * k)
    q[0], q[1], q[2], q[3] = w * s, i * s, j * s, k * s


@numba.njit(cache=True, nogil=True, fastmath=FAST)  # type: ignore[misc, unused-ignore]
def times_cross(M, r, k, out):  # type: ignore[no-untyped-def]
    """out = k M [r]×."""
    for i in range(3):
        x, y, z = k * M[i, 0], k * M[i, 1], k * M[i, 2]
        out[i, 0] = y * r[2] - z * r[1]
        out[i, 1] = z * r[0] - x * r[2]
        out[i, 2] = x * r[1] - y * r[0]


@numba.njit(cache=True, nogil=True, fastmath=FAST)  # type: ignore[misc, unused-ignore]
def exponential(phi, k, c1, c2, out):  # type: ignore[no-untyped-def]
    """out = 1 k + c1 [phi]× + c2 [phi]×²; the exponential and its Jacobians are of this form."""
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


@numba.njit(cache=True, nogil=True, fastmath=FAST)  # type: ignore[misc, unused-ignore]
def product(A, B, k, out):  # type: ignore[no-untyped-def]
    """out = k A B."""
    for i in range(3):
        for j in range(3):
            out[i, j] = k * (A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j])
