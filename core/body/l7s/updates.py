"""Common parts of every L7S update with its local error ε ∈ R²⁷: one row, the injection, the reset of P.

X ← X Exp(ε), ε = (ρ_p φ_p ρ_lf φ_lf ρ_rf φ_rf ν_p ν_lf ν_rf). With diagonal R the stacked update of Sy 2021
eq 9–12 equals sequential rows at one linearisation: the correction dx is accumulated and the residual of each
row is evaluated at dx (docs/science/erkf.md, "Corrections").

P is stored flat, its rows padded with zeros to 28 numbers: the compiler then knows the stride and processes
four or eight numbers of a row at once.
"""

from __future__ import annotations

from math import sqrt

import numba
import numpy as np

from sagittal.core.body.se3 import move_pose, right_jacobian
from sagittal.core.signals.inner import UNCOUNTED, inner_njit

N = 27
"""Length of the error vector."""

WIDTH = 28
"""Of a row of P, and rows of it: the last of both is 0."""

VELOCITY = 18
"""Where the velocities begin in the error vector."""


@inner_njit()
def make_form():  # type: ignore[no-untyped-def]
    """Allocate three rows of a measurement, as used by `apply_rows`."""
    return np.zeros(3, np.int64), np.zeros((3, 9)), np.zeros(3), np.zeros(3), np.zeros(3 * WIDTH)


@inner_njit(error_model="numpy", **UNCOUNTED)
def apply_rows(P, dx, triples, form):  # type: ignore[no-untyped-def]
    """Apply three rows of the stacked update, with P last: memory access costs more than the arithmetic.

    Parameters
    ----------
    dx : (28,), with a length unknown to the compiler, which would otherwise unroll the loops instead of
        vectorising them. triples : number of positions, rotations or velocities that the rows involve. form :
        of `make_form`; their offsets in ε, H of the rows at those, residuals, variances, and space for gains.
        A row of zeros has no effect.
    """
    offsets, H, residual, variance, gain = form
    n = len(dx)
    for j in range(3 * n):
        gain[j] = 0.0
    for t in range(triples):
        rows, k = P[WIDTH * offsets[t] :], 3 * t
        a, b, c, d, e, f = H[0, k], H[0, k + 1], H[0, k + 2], H[1, k], H[1, k + 1], H[1, k + 2]
        g, h, i = H[2, k], H[2, k + 1], H[2, k + 2]
        for j in range(n):
            x, y, z = rows[j], rows[WIDTH + j], rows[2 * WIDTH + j]
            gain[j] += a * x + b * y + c * z
            gain[WIDTH + j] += d * x + e * y + f * z
            gain[2 * WIDTH + j] += g * x + h * y + i * z
    for m in range(3):
        own, total, left = WIDTH * m, variance[m], residual[m]
        for row_start in range(0, own, WIDTH):
            share = 0.0
            for t in range(triples):
                for i in range(3):
                    share += H[m, 3 * t + i] * gain[row_start + offsets[t] + i]
            for j in range(n):
                gain[own + j] -= share * gain[row_start + j]
        for t in range(triples):
            for i in range(3):
                total += H[m, 3 * t + i] * gain[own + offsets[t] + i]
                left -= H[m, 3 * t + i] * dx[offsets[t] + i]
        # P − g gᵀ with g over the root: as symmetric as P was
        scale = 1.0 / sqrt(total)
        left *= scale
        for j in range(n):
            gain[own + j] *= scale
            dx[j] += gain[own + j] * left
    for i in range(0, WIDTH, 2):
        row = WIDTH * i
        a, b, c = gain[i], gain[WIDTH + i], gain[2 * WIDTH + i]
        d, e, f = gain[i + 1], gain[WIDTH + i + 1], gain[2 * WIDTH + i + 1]
        for j in range(n):
            x, y, z = gain[j], gain[WIDTH + j], gain[2 * WIDTH + j]
            P[row + j] -= a * x + b * y + c * z
            P[row + WIDTH + j] -= d * x + e * y + f * z


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def inject(R, p, v, dx, work):  # type: ignore[no-untyped-def]
    """X ← X Exp(dx); work is (3, 3, 3) of scratch."""
    for b in range(len(R)):
        move_pose(R[b], p[b], dx, 6 * b, work)
        for i in range(3):
            v[b, i] += dx[VELOCITY + 3 * b + i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def reset(P, dx, blocks):  # type: ignore[no-untyped-def]
    """P ← Φ(dx) P Φ(dx)ᵀ (eq 12), symmetric again; `blocks` (3, 2, 3, 3) is scratch."""
    for b in range(3):
        right_jacobian(dx, 6 * b, blocks[b, 0], blocks[b, 1])
    n = len(dx)
    _turn_rows(P, blocks, n)
    _transpose(P, n)
    _turn_rows(P, blocks, n)
    for i in range(n):
        for j in range(i):
            mean = 0.5 * (P[WIDTH * i + j] + P[WIDTH * j + i])
            P[WIDTH * i + j] = mean
            P[WIDTH * j + i] = mean


@inner_njit(**UNCOUNTED)
def _turn_rows(P, blocks, n):  # type: ignore[no-untyped-def]
    """P ← Φ P."""
    for b in range(3):
        J, K, rows = blocks[b, 0], blocks[b, 1], P[WIDTH * 6 * b :]
        for j in range(n):
            r, s, t = rows[j], rows[j + WIDTH], rows[j + 2 * WIDTH]
            x, y, z = rows[j + 3 * WIDTH], rows[j + 4 * WIDTH], rows[j + 5 * WIDTH]
            rows[j] = J[0, 0] * r + J[0, 1] * s + J[0, 2] * t + K[0, 0] * x + K[0, 1] * y + K[0, 2] * z
            rows[j + WIDTH] = (
                J[1, 0] * r + J[1, 1] * s + J[1, 2] * t + K[1, 0] * x + K[1, 1] * y + K[1, 2] * z
            )
            rows[j + 2 * WIDTH] = (
                J[2, 0] * r + J[2, 1] * s + J[2, 2] * t + K[2, 0] * x + K[2, 1] * y + K[2, 2] * z
            )
            rows[j + 3 * WIDTH] = J[0, 0] * x + J[0, 1] * y + J[0, 2] * z
            rows[j + 4 * WIDTH] = J[1, 0] * x + J[1, 1] * y + J[1, 2] * z
            rows[j + 5 * WIDTH] = J[2, 0] * x + J[2, 1] * y + J[2, 2] * z


@inner_njit(**UNCOUNTED)
def _transpose(P, n):  # type: ignore[no-untyped-def]
    """P ← Pᵀ."""
    for i in range(n):
        for j in range(i):
            P[WIDTH * i + j], P[WIDTH * j + i] = P[WIDTH * j + i], P[WIDTH * i + j]
