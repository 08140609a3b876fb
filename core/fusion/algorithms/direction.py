"""Engine E6: filters of directions in sensor axes, from which the orientation is constructed.

Equations: docs/science/filters.md, "E6 Direction filters".
"""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.gain_kernel import choose_level
from sagittal.core.fusion.algorithms.kalman import take_scalar
from sagittal.core.fusion.algorithms.vectors import (
    dot,
    half_turn,
    level,
    normalise,
    read_sample,
    to_sensor,
    turn_by,
    unit,
)
from sagittal.core.rotation.compiled import cross, from_matrix

KINDS: Final = ("two_vectors", "vertical")
"""Filters; their place here is their number in the compiled loop."""
TWO_VECTORS, VERTICAL = range(2)

GAINS: Final = ("sigma_g", "sigma_a", "sigma_m")
CONSTANTS: Final = ("p_a", "p_m", "c_a", "s_a", "c_m", "s_m", "p_dcm", "p_b", "s_b", "sigma_f")
P_A, P_M, C_A, S_A, C_M, S_M, P_DCM, P_B, S_B, SIGMA_F = range(10)

LKF: Final = 6 + 36
"""Floats of one linear filter: direction (3), disturbance (3), covariance."""
SIZE: Final = 7 + 2 * LKF
"""Floats of state per sensor: q (4), gyroscope bias (3), two linear filters (`vertical` uses one)."""
BIAS: Final = 4


def start_state(kind: str, q: Floats, up: Floats, field: Floats, constants: Floats) -> Floats:
    """State (SIZE,) at an orientation q (4,) with vertical and field (3,) in sensor axes."""
    if kind == "vertical":
        first, second = (constants[P_DCM], constants[P_B]), (0.0, 0.0)
    else:
        first, second = (constants[P_A], constants[P_A]), (constants[P_M], constants[P_M])
    parts = [
        np.concatenate((v, np.zeros(3), np.diag(np.repeat(p, 3)).ravel()))
        for v, p in ((up, first), (field, second))
    ]
    return np.concatenate((q, np.zeros(3), *parts))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_direction(kind, gyr, acc, mag, dt, m_ref, rows, constants, state, out):  # type: ignore[no-untyped-def]
    """Advance S sensors over n samples; arrays as in `run_complementary`, rows of σ_G, σ_A, σ_M."""
    w, a, m = np.empty(3), np.empty(3), np.empty(3)
    E, R, V, work = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 6)), np.empty((3, 3))
    h, dx, u, new = np.zeros(6), np.empty(6), np.empty(6), np.empty(4)
    for s in range(gyr.shape[1]):
        x = state[s]
        q, b = x[0:4], x[4:7]
        one, P1 = x[7:13], x[13 : 7 + LKF].reshape(6, 6)
        two, P2 = x[7 + LKF : 13 + LKF], x[13 + LKF :].reshape(6, 6)
        for k in range(gyr.shape[0]):
            has_a, has_m, da, dm, rate = read_sample(gyr, acc, mag, k, s, w, a, m)
            sigma_g = choose_level(rows, 0, da, dm, rate)
            sigma_a = choose_level(rows, 1, da, dm, rate)
            sigma_m = choose_level(rows, 2, da, dm, rate)
            for i in range(3):
                w[i] = dt * (w[i] - b[i])
            turn_by(q, w[0], w[1], w[2])
            _turn_back(w, E)
            if kind == TWO_VECTORS:
                _advance_vector(one, P1, E, V, dt * sigma_g, constants[C_A], constants[S_A], work)
                _advance_vector(two, P2, E, V, dt * sigma_g, constants[C_M], constants[S_M], work)
                if has_a:
                    _take_sum(one, P1, a, sigma_a, h, dx, u)
                if has_m:
                    _take_sum(two, P2, m, sigma_m, h, dx, u)
                if level(one[:3], two[:3], R):
                    from_matrix(R, new)
                    sign = (
                        1.0 if q[0] * new[0] + q[1] * new[1] + q[2] * new[2] + q[3] * new[3] >= 0.0 else -1.0
                    )
                    for i in range(4):
                        q[i] = sign * new[i]
            else:
                _advance_vertical(one, P1, E, V, dt, sigma_g, constants[S_B])
                if has_a:
                    _take_vertical(one, P1, a, sigma_a, constants[SIGMA_F], h, dx, u, work, V)
                for i in range(3):
                    b[i] = one[3 + i]
                # the shortest turn brings the vertical of q onto the estimated one: heading stays integrated
                work[0, 0], work[0, 1], work[0, 2] = 0.0, 0.0, 1.0
                to_sensor(q, work[0], work[1])
                cross(one[:3], work[1], work[2])
                turn_by(q, work[2, 0], work[2, 1], work[2, 2])
            normalise(q)
            for i in range(4):
                out[k, s, i] = q[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _turn_back(turn, E):  # type: ignore[no-untyped-def]
    """Write Exp(−turn) (3, 3): the motion of a world direction in sensor axes."""
    h, i, j, k = half_turn(turn[0], turn[1], turn[2])
    E[0, 0], E[0, 1], E[0, 2] = 1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j + h * k), 2.0 * (i * k - h * j)
    E[1, 0], E[1, 1], E[1, 2] = 2.0 * (i * j - h * k), 1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k + h * i)
    E[2, 0], E[2, 1], E[2, 2] = 2.0 * (i * k + h * j), 2.0 * (j * k - h * i), 1.0 - 2.0 * (i * i + j * j)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _advance_vector(x, P, E, V, angle, c, s, work):  # type: ignore[no-untyped-def]
    """Ligorio 2015: g rotates with the sensor, with noise σ_G T perpendicular to it; its disturbance
    decays by c.
    """
    for i in range(3):
        work[0, i] = E[i, 0] * x[0] + E[i, 1] * x[1] + E[i, 2] * x[2]
        x[3 + i] *= c
        for j in range(6):
            V[i, j] = E[i, 0] * P[0, j] + E[i, 1] * P[1, j] + E[i, 2] * P[2, j]
    x[0], x[1], x[2] = work[0, 0], work[0, 1], work[0, 2]
    square = dot(x, x)
    for i in range(3):
        for j in range(3):
            noise = (square if i == j else 0.0) - x[i] * x[j]
            P[i, j] = V[i, 0] * E[j, 0] + V[i, 1] * E[j, 1] + V[i, 2] * E[j, 2] + angle * angle * noise
            P[i, 3 + j] = c * V[i, 3 + j]
            P[3 + j, i] = P[i, 3 + j]
            P[3 + i, 3 + j] *= c * c
        P[3 + i, 3 + i] += s * s
    for i in range(3):
        for j in range(i):
            P[i, j] = P[j, i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _take_sum(x, P, y, sigma, h, dx, u):  # type: ignore[no-untyped-def]
    """Rows y = g + disturbance."""
    dx[:] = 0.0
    for i in range(3):
        h[:] = 0.0
        h[i], h[3 + i] = 1.0, 1.0
        take_scalar(P, h, sigma * sigma, y[i] - x[i] - x[3 + i], dx, u)
    for i in range(6):
        x[i] += dx[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _advance_vertical(x, P, E, V, dt, sigma_g, s_b):  # type: ignore[no-untyped-def]
    """Hyyti 2015, eq 6 to 12: g⁺ = Exp(−ωT) g, ∂g⁺/∂b = −T [g]×, noise σ_G T across g, bias walk."""
    g = (x[0], x[1], x[2])
    for i in range(3):
        x[i] = E[i, 0] * g[0] + E[i, 1] * g[1] + E[i, 2] * g[2]
    x0, x1, x2 = x[0], x[1], x[2]
    for j in range(6):
        # −[g]× v = v × g
        p0, p1, p2 = P[3, j], P[4, j], P[5, j]
        c0, c1, c2 = p1 * x2 - p2 * x1, p2 * x0 - p0 * x2, p0 * x1 - p1 * x0
        V[0, j] = E[0, 0] * P[0, j] + E[0, 1] * P[1, j] + E[0, 2] * P[2, j] + dt * c0
        V[1, j] = E[1, 0] * P[0, j] + E[1, 1] * P[1, j] + E[1, 2] * P[2, j] + dt * c1
        V[2, j] = E[2, 0] * P[0, j] + E[2, 1] * P[1, j] + E[2, 2] * P[2, j] + dt * c2
    square, variance = x0 * x0 + x1 * x1 + x2 * x2, (dt * sigma_g) ** 2
    for i in range(3):
        p0, p1, p2 = V[i, 3], V[i, 4], V[i, 5]
        c = (p1 * x2 - p2 * x1, p2 * x0 - p0 * x2, p0 * x1 - p1 * x0)
        for j in range(i + 1):
            total = V[i, 0] * E[j, 0] + V[i, 1] * E[j, 1] + V[i, 2] * E[j, 2] + dt * c[j]
            total += variance * ((square if i == j else 0.0) - x[i] * x[j])
            P[i, j] = total
            P[j, i] = total
        for j in range(3):
            P[i, 3 + j] = V[i, 3 + j]
            P[3 + j, i] = V[i, 3 + j]
        P[3 + i, 3 + i] += s_b * s_b * dt


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _take_vertical(x, P, a, r_a, r_f, h, dx, u, work, V):  # type: ignore[no-untyped-def]
    """Rows a = g with R = r_a² ‖a − g‖² + r_f², then normalisation of g and its covariance (eq 13 to 20)."""
    square = (a[0] - x[0]) ** 2 + (a[1] - x[1]) ** 2 + (a[2] - x[2]) ** 2
    variance = r_a * r_a * square + r_f * r_f
    dx[:] = 0.0
    for i in range(3):
        h[:] = 0.0
        h[i] = 1.0
        take_scalar(P, h, variance, a[i] - x[i], dx, u)
    for i in range(6):
        x[i] += dx[i]
    norm = unit(x[:3], work[0])
    # J = (1 − g gᵀ)/‖g‖ on the direction's rows and columns
    for j in range(6):
        along = work[0, 0] * P[0, j] + work[0, 1] * P[1, j] + work[0, 2] * P[2, j]
        for i in range(3):
            V[i, j] = (P[i, j] - work[0, i] * along) / norm
    for i in range(3):
        along = work[0, 0] * V[i, 0] + work[0, 1] * V[i, 1] + work[0, 2] * V[i, 2]
        for j in range(i + 1):
            P[i, j] = (V[i, j] - along * work[0, j]) / norm
            P[j, i] = P[i, j]
        for j in range(3, 6):
            P[i, j] = V[i, j]
            P[j, i] = V[i, j]
        x[i] = work[0, i]
