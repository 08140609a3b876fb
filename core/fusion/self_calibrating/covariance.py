"""Error propagation over an interval, and scalar updates: compiled, one sensor.

Equations: docs/science/self-calibrating-filter.md, "An interval".
"""

from __future__ import annotations

from math import sqrt

import numba

from sagittal.core.fusion.self_calibrating.layout import (
    ACC_BIAS,
    ACC_DELAY,
    BIAS,
    FIELD,
    GRAVITY,
    MATRIX,
    S_ACC,
    S_CROSS,
    S_R,
    S_R_RATE,
    S_SHAKING,
    SHAKEN,
    SPEED,
    TILT,
    WITH_MAG,
)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def write_transition(sums, n, duration, F):  # type: ignore[no-untyped-def]
    """Write F (6, m), the change of the errors of orientation (rows 0-2) and velocity (3-5) over an interval.

    The change only, without the identity; heading errors rotate the velocity and do not tilt it.
    """
    F[:] = 0.0
    shaking = sums[S_SHAKING] / n
    for r in range(3):
        for j in range(3):
            F[r, BIAS + j] = -sums[S_R + 3 * r + j]
            F[r, SHAKEN + j] = shaking * F[r, BIAS + j]
            F[3 + r, ACC_BIAS + j] = -sums[S_R + 3 * r + j]
        for j in range(9):
            F[r, MATRIX + j] = -sums[S_R_RATE + 9 * r + j]
        F[3 + r, ACC_DELAY] = -sums[S_CROSS + r]
    ax, ay, az = sums[S_ACC], sums[S_ACC + 1], sums[S_ACC + 2]
    F[3, TILT + 1] = az
    F[4, TILT] = -az
    F[5, TILT] = ay
    F[5, TILT + 1] = -ax
    for r in range(3, 6):
        # the orientation's error grows over the interval: half of it tilts the acceleration on average
        for j in range(3):
            F[r, BIAS + j] = 0.5 * (F[r, TILT] * F[0, BIAS + j] + F[r, TILT + 1] * F[1, BIAS + j])
            F[r, SHAKEN + j] = shaking * F[r, BIAS + j]
        for j in range(9):
            F[r, MATRIX + j] = 0.5 * (F[r, TILT] * F[0, MATRIX + j] + F[r, TILT + 1] * F[1, MATRIX + j])
    F[5, GRAVITY] = -duration


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def place_of(row):  # type: ignore[no-untyped-def]
    """Index of the error that a row of F belongs to."""
    return row if row < 3 else SPEED + row - 3


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def predict_covariance(P, F, decay, work):  # type: ignore[no-untyped-def]
    """P ← Φ P Φᵀ in place, Φ = 1 + F in its six rows, the field's deviation times decay; work (6, m)."""
    m = P.shape[0]
    for r in range(6):
        for j in range(m):
            work[r, j] = 0.0
        for c in range(m):
            f = F[r, c]
            if f != 0.0:
                for j in range(m):
                    work[r, j] += f * P[c, j]
    # P + F P + (F P)ᵀ + F P Fᵀ: the same number on both sides of the diagonal
    for r in range(6):
        k = place_of(r)
        for j in range(m):
            P[k, j] += work[r, j]
        for i in range(m):
            P[i, k] += work[r, i]
    for r in range(6):
        for s in range(r + 1):
            t = 0.0
            for c in range(m):
                t += work[r, c] * F[s, c]
            i, j = place_of(r), place_of(s)
            P[i, j] += t
            P[j, i] = P[i, j]
    if m == WITH_MAG:
        for i in range(FIELD, FIELD + 3):
            for j in range(m):
                P[i, j] *= decay
            for j in range(m):
                P[j, i] *= decay


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def take_scalar(P, d, K, columns, h, m, residual, variance):  # type: ignore[no-untyped-def]
    """Scalar update with residual = Σ h_j error[at_j] + noise, j < m, of P and the estimate d, both in place.

    Only the lower triangle of P is used; K (n,) is scratch for the gain.
    """
    n = P.shape[0]
    s, e = variance, residual
    for i in range(n):
        K[i] = 0.0
    for j in range(m):
        a, f = columns[j], h[j]
        for i in range(a):
            K[i] += P[a, i] * f
        for i in range(a, n):
            K[i] += P[i, a] * f
    for j in range(m):
        s += h[j] * K[columns[j]]
        e -= h[j] * d[columns[j]]
    e /= s
    for i in range(n):
        k = K[i] / s
        d[i] += K[i] * e
        for j in range(i + 1):
            P[i, j] -= k * K[j]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def solve(A, b, L):  # type: ignore[no-untyped-def]
    """b ← A⁻¹ b in place for a symmetric positive definite A (n, n); L is scratch for its factor."""
    n = len(b)
    for j in range(n):
        t = A[j, j]
        for k in range(j):
            t -= L[j, k] * L[j, k]
        L[j, j] = sqrt(t) if t > 1e-300 else 1e-150
        for i in range(j + 1, n):
            t = A[i, j]
            for k in range(j):
                t -= L[i, k] * L[j, k]
            L[i, j] = t / L[j, j]
    for i in range(n):
        t = b[i]
        for k in range(i):
            t -= L[i, k] * b[k]
        b[i] = t / L[i, i]
    for i in range(n - 1, -1, -1):
        t = b[i]
        for k in range(i + 1, n):
            t -= L[k, i] * b[k]
        b[i] = t / L[i, i]
