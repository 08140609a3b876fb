"""Engine E5: Kalman filters of the error of an orientation, in sensor axes, and of biases and disturbances.

Three of the five separate the heading: the magnetometer rotates about the vertical only, by a scalar
innovation. Equations: docs/science/filters.md, "E5 Error-state filters".
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import numba
import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.gain_kernel import choose_level
from sagittal.core.fusion.algorithms.kalman import take_block, take_scalar
from sagittal.core.fusion.algorithms.vectors import (
    dot,
    half_turn,
    heading_error,
    normalise,
    read_sample,
    to_sensor,
    turn_by,
)

KINDS: Final = ("multiplicative", "split", "windowed", "external", "disturbed")
"""Filters; their place here is their number in the compiled loop."""
MULTIPLICATIVE, SPLIT, WINDOWED, EXTERNAL, DISTURBED = range(5)
STATES: Final = (6, 3, 3, 9, 12)
"""Errors estimated: of orientation; of the gyroscope bias; of the accelerometer bias (external), or of
acceleration and magnetic disturbance (disturbed)."""

GAINS: Final = ("sigma_g", "sigma_a", "sigma_m")
CONSTANTS: Final = (
    "p0", "p_b", "p_b_a", "s_b", "s_b_a", "m1", "m2", "gamma", "c_a", "c_m", "n_s", "n_l", "n_m", "xi_a",
    "xi_xy", "xi", "gamma_d", "sigma_d", "m_exp",
)  # fmt: skip
(
    P0, P_B, P_B_A, S_B, S_B_A, M1, M2, GAMMA, C_A, C_M, N_S, N_L, N_M, XI_A, XI_XY, XI, GAMMA_D, SIGMA_D,
    M_EXP,
) = range(19)  # fmt: skip

LONGEST: Final = 16
"""Samples that the window M₁ of `external` may have."""
HEAD: Final = 13 + 3 * LONGEST + 2
"""Floats before the covariance: q (4), b (3), a or b_A (3), d (3), a window of residuals, two counters."""

ACCELERATION_DECAY: Final = 0.5
"""Share of the acceleration of `disturbed` left after a sample at 100 Hz, of the vendor's defaults."""


def start_state(kind: str, q: Floats, p0: float, p_b: float, p_b_a: float, learns_bias: bool) -> Floats:
    """State (size,) at an orientation q (4,); variances of orientation, gyroscope and accelerometer bias."""
    n = STATES[KINDS.index(kind)]
    P = np.diag(np.repeat([p0, p_b if learns_bias else 0.0, p_b_a, p0], 3)[:n])
    return np.concatenate((q, np.zeros(HEAD - 4), P.ravel()))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_error_state(kind, n, decay_a, gyr, acc, mag, dt, m_ref, rows, constants, state, out):  # type: ignore[no-untyped-def]
    """Advance S sensors over n samples; arrays as in `run_complementary`, rows of σ_G, σ_A, σ_M.

    Parameters
    ----------
    n : number of states. decay_a : fraction of the acceleration of `disturbed` left after a sample.
    """
    w, a, m, up = np.empty(3), np.empty(3), np.empty(3), np.zeros(3)
    up[2] = 1.0
    v, work, E, V = np.empty(3), np.empty((2, 3)), np.empty((3, 3)), np.empty((3, n))
    h, dx, u = np.zeros(n), np.empty(n), np.empty(n)
    U, R, H, S, L, W = (
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, n)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, n)),
    )
    split = kind in (SPLIT, WINDOWED, EXTERNAL)
    for s in range(gyr.shape[1]):
        x, P = state[s, :HEAD], state[s, HEAD:].reshape(n, n)
        q, b, own, d, r = x[0:4], x[4:7], x[7:10], x[10:13], m_ref[s]
        cos_dip = sqrt(r[0] * r[0] + r[1] * r[1])
        for k in range(gyr.shape[0]):
            has_a, has_m, da, dm, rate = read_sample(gyr, acc, mag, k, s, w, a, m)
            sigma_g = choose_level(rows, 0, da, dm, rate)
            sigma_a = choose_level(rows, 1, da, dm, rate)
            sigma_m = choose_level(rows, 2, da, dm, rate)
            _predict(kind, q, b, own, d, P, w, dt, sigma_g, decay_a, constants, E, V)
            dx[:] = 0.0
            if has_a:
                to_sensor(q, up, v)
                for i in range(3):
                    a[i] -= v[i] + own[i]
                if kind == EXTERNAL:
                    _take_external(x, P, a, v, sigma_a, constants, dx, U, R, H, S, L, W)
                else:
                    variance = sigma_a * sigma_a
                    if kind == WINDOWED:
                        variance = _widen(x, dot(a, a) / 3.0, constants)
                    for i in range(3):
                        _point_row(h, v, i)
                        if kind == DISTURBED:
                            h[6 + i] = 1.0
                        take_scalar(P, h, variance, a[i], dx, u)
            if has_m and split:
                _inject(kind, q, b, own, d, dx)
                error = heading_error(q, m, work[0])
                to_sensor(q, up, v)
                h[:] = 0.0
                h[0], h[1], h[2] = v[0], v[1], v[2]
                variance = (sigma_m / cos_dip) ** 2
                if kind == WINDOWED:
                    x[15] += (error * error - x[15]) / constants[N_M]
                    variance = constants[XI_XY] ** 2 + constants[C_M] * x[15]
                take_scalar(P, h, variance, error, dx, u)
            elif has_m and not (kind == DISTURBED and dot(d, d) > 4.0 * constants[M_EXP] ** 2):
                to_sensor(q, r, v)
                for i in range(3):
                    _point_row(h, v, i)
                    if kind == DISTURBED:
                        h[9 + i] = 1.0
                    take_scalar(P, h, sigma_m * sigma_m, m[i] - v[i] - d[i], dx, u)
            _inject(kind, q, b, own, d, dx)
            normalise(q)
            for i in range(4):
                out[k, s, i] = q[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _predict(kind, q, b, own, d, P, w, dt, sigma_g, decay_a, c, E, V):  # type: ignore[no-untyped-def]
    """δθ ← Exp(−ωT) δθ − T δb; biases stay, acceleration and disturbance decay."""
    n = P.shape[0]
    x, y, z = dt * (w[0] - b[0]), dt * (w[1] - b[1]), dt * (w[2] - b[2])
    turn_by(q, x, y, z)
    h, i, j, k = half_turn(x, y, z)
    E[0, 0], E[0, 1], E[0, 2] = 1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j + h * k), 2.0 * (i * k - h * j)
    E[1, 0], E[1, 1], E[1, 2] = 2.0 * (i * j - h * k), 1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k + h * i)
    E[2, 0], E[2, 1], E[2, 2] = 2.0 * (i * k + h * j), 2.0 * (j * k - h * i), 1.0 - 2.0 * (i * i + j * j)
    for i in range(3):
        for j in range(n):
            V[i, j] = E[i, 0] * P[0, j] + E[i, 1] * P[1, j] + E[i, 2] * P[2, j]
            if n > 3:
                V[i, j] -= dt * P[3 + i, j]
    keeps_a = decay_a if kind == DISTURBED else 1.0
    for i in range(3):
        for j in range(i + 1):
            total = V[i, 0] * E[j, 0] + V[i, 1] * E[j, 1] + V[i, 2] * E[j, 2]
            if n > 3:
                total -= dt * V[i, 3 + j]
            P[i, j] = total
            P[j, i] = total
        P[i, i] += (dt * sigma_g) ** 2
        for j in range(3, n):
            total = V[i, j] * (1.0 if j < 6 else keeps_a if j < 9 else c[SIGMA_D])
            P[i, j] = total
            P[j, i] = total
    for i in range(3, n):
        for j in range(3, n):
            P[i, j] *= 1.0 if i < 6 else keeps_a if i < 9 else c[SIGMA_D]
            P[i, j] *= 1.0 if j < 6 else keeps_a if j < 9 else c[SIGMA_D]
        if i < 6:
            P[i, i] += c[S_B] ** 2 * dt
        elif i < 9:
            P[i, i] += c[XI] if kind == DISTURBED else c[S_B_A] ** 2 * dt
        else:
            P[i, i] += c[GAMMA_D]
    if kind == DISTURBED:
        for i in range(3):
            own[i] *= keeps_a
            d[i] *= c[SIGMA_D]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _point_row(h, v, i):  # type: ignore[no-untyped-def]
    """Write row i of [v]× to the first three of h (n,), zeros to the others."""
    h[:] = 0.0
    if i == 0:
        h[1], h[2] = -v[2], v[1]
    elif i == 1:
        h[0], h[2] = v[2], -v[0]
    else:
        h[0], h[1] = -v[1], v[0]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _inject(kind, q, b, own, d, dx):  # type: ignore[no-untyped-def]
    """Transfer the estimated errors to the states, and reset them to zero."""
    turn_by(q, dx[0], dx[1], dx[2])
    n = dx.shape[0]
    for i in range(3):
        if n > 3:
            b[i] += dx[3 + i]
        if n > 6:
            own[i] += dx[6 + i]
        if n > 9:
            d[i] += dx[9 + i]
    dx[:] = 0.0


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _widen(x, square, c):  # type: ignore[no-untyped-def]
    """Del Rosario 2018 (reconstruction): the noise follows short and long running means of the residual."""
    x[13] += (square - x[13]) / c[N_S]
    x[14] += (square - x[14]) / c[N_L]
    return c[XI_A] ** 2 + c[C_A] * max(x[13], x[14])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _take_external(x, P, y, v, sigma_a, c, dx, U, R, H, S, L, W):  # type: ignore[no-untyped-def]
    """Suh 2010, eq 22 to 33: residual spread in excess of the model is attributed to external
    acceleration.
    """
    count = int(c[M1])
    slot = int(x[HEAD - 2])
    for i in range(3):
        x[13 + 3 * slot + i] = y[i]
    x[HEAD - 2] = (slot + 1) % count
    for i in range(3):
        _point_row(H[i], v, i)
        H[i, 6 + i] = 1.0
        for j in range(3):
            U[i, j] = 0.0
            for k in range(count):
                U[i, j] += x[13 + 3 * k + i] * x[13 + 3 * k + j] / count
            R[i, j] = sigma_a * sigma_a if i == j else 0.0
    axes = L
    principal_axes(U, axes)
    largest = 0.0
    for k in range(3):
        # expected spread along axis k: uᵀ (H P Hᵀ + R) u
        expected = sigma_a * sigma_a
        for j in range(P.shape[0]):
            row = H[0, j] * axes[0, k] + H[1, j] * axes[1, k] + H[2, j] * axes[2, k]
            if row != 0.0:
                for i in range(P.shape[0]):
                    expected += (
                        row * P[j, i] * (H[0, i] * axes[0, k] + H[1, i] * axes[1, k] + H[2, i] * axes[2, k])
                    )
        U[k, k] -= expected
        largest = max(largest, U[k, k])
    # counts down the samples for which an acceleration is still taken to go on
    x[HEAD - 1] = c[M2] + 1.0 if largest > c[GAMMA] else max(x[HEAD - 1] - 1.0, 0.0)
    if x[HEAD - 1] > 0.0:
        for k in range(3):
            for i in range(3):
                for j in range(3):
                    R[i, j] += max(U[k, k], 0.0) * axes[i, k] * axes[j, k]
    take_block(P, H, R, y, dx, S, L, W)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def principal_axes(A, axes):  # type: ignore[no-untyped-def]
    """Diagonalise a symmetric A (3, 3) in place and write its eigenvectors as columns (Jacobi)."""
    for i in range(3):
        for j in range(3):
            axes[i, j] = 1.0 if i == j else 0.0
    for _ in range(12):
        for p in range(2):
            for o in range(p + 1, 3):
                if A[p, o] == 0.0:
                    continue
                tau = (A[o, o] - A[p, p]) / (2.0 * A[p, o])
                t = (1.0 if tau >= 0.0 else -1.0) / (abs(tau) + sqrt(1.0 + tau * tau))
                c = 1.0 / sqrt(1.0 + t * t)
                s = t * c
                for k in range(3):
                    A[k, p], A[k, o] = c * A[k, p] - s * A[k, o], s * A[k, p] + c * A[k, o]
                for k in range(3):
                    A[p, k], A[o, k] = c * A[p, k] - s * A[o, k], s * A[p, k] + c * A[o, k]
                for k in range(3):
                    axes[k, p], axes[k, o] = c * axes[k, p] - s * axes[k, o], s * axes[k, p] + c * axes[k, o]
        if A[0, 1] == 0.0 and A[0, 2] == 0.0 and A[1, 2] == 0.0:
            break
