"""Engine E3: extended Kalman filters of the quaternion and any of five blocks of three states.

Blocks: non-gravitational acceleration a, gyroscope bias b, magnetic disturbance d, accelerometer bias b_A,
magnetometer bias b_M. A finite γ makes the filter H∞. The covariance is propagated block by block and updated
row by row: about a microsecond per sample. Equations: docs/science/filters.md, "E3 Extended Kalman filters".
"""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.gain_kernel import choose_level
from sagittal.core.fusion.algorithms.kalman import bound_worst_case, take_scalar
from sagittal.core.fusion.algorithms.vectors import (
    direction_jacobian,
    dot,
    half_turn,
    normalise,
    rate_jacobian,
    read_sample,
    to_sensor,
)
from sagittal.core.rotation.compiled import multiply

BLOCKS: Final = {
    "bias": "b",
    "quasi_static": "ba",
    "acceleration": "ba",
    "sensor_biases": "AM",
    "full": "abd",
}
"""Kind → its blocks of states, in order; A and M are b_A and b_M."""

GAINS: Final = ("sigma_g", "sigma_a", "sigma_m")
CONSTANTS: Final = ("p0", "c_a", "c_d", "s_a", "s_b", "s_d", "s_b_a", "s_b_m", "gamma")
P0, C_A, C_D, S_A, S_B, S_D, S_B_A, S_B_M, GAMMA = range(9)

WINDOW: Final = 10
"""Samples in which ‖y_A‖ and ‖y_M‖ must hold still to count as quasi-static (Renaudin 2014)."""
RING: Final = 2 * WINDOW + 1


def find_blocks(kind: str, learns_bias: bool) -> str:
    """Blocks of states of a filter; without a magnetometer neither b nor the magnetic ones."""
    blocks = BLOCKS[kind]
    return blocks if learns_bias else "".join(x for x in blocks if x not in "bdM")


def start_state(blocks: str, q: Floats, p0: float) -> Floats:
    """State (size,) at an orientation q (4,)."""
    n = 4 + 3 * len(blocks)
    ring = np.concatenate((np.ones(2 * WINDOW), [0.0]))
    return np.concatenate((q, np.zeros(n - 4), (p0 * np.eye(n)).ravel(), ring))


def place_blocks(blocks: str) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """First state of a, b, d, b_A, b_M (5,); −1 for those a filter does not have."""
    return np.array([4 + 3 * blocks.index(x) if x in blocks else -1 for x in "abdAM"], np.int64)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_extended_kalman(quasi_static, places, gyr, acc, mag, dt, m_ref, rows, constants, state, out):  # type: ignore[no-untyped-def]
    """Advance S sensors over n samples; arrays as in `run_complementary`, rows of σ_G, σ_A, σ_M.

    A filter that diverges (γ too small) leaves NaN in state and `out`.

    Parameters
    ----------
    quasi_static : levels chosen by the spread of norms over a window instead of the deviation. places : (5,).
    """
    n = 4
    for i in range(5):
        if places[i] >= 0:
            n += 3
    w, a, m, f, r = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    turn, B, xi, V, J = (
        np.empty((4, 4)),
        np.empty((4, 3)),
        np.empty((4, 3)),
        np.empty((4, n)),
        np.empty((3, 4)),
    )
    h, dx, u = np.zeros(n), np.empty(n), np.empty(n)
    A, L, U = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    decay, noise = _list_blocks(places, n, dt, constants)
    square = constants[GAMMA] ** 2
    for s in range(gyr.shape[1]):
        x, P, ring = state[s, :n], state[s, n : n + n * n].reshape(n, n), state[s, n + n * n :]
        for k in range(gyr.shape[0]):
            has_a, has_m, da, dm, rate = read_sample(gyr, acc, mag, k, s, w, a, m)
            if quasi_static:
                da, dm = _spread_norms(ring, a, m, has_a, has_m)
            sigma_g = choose_level(rows, 0, da, dm, rate)
            sigma_a = choose_level(rows, 1, da, dm, rate)
            sigma_m = choose_level(rows, 2, da, dm, rate)
            predict_state(x, P, w, dt, sigma_g, places[1], decay, noise, turn, B, xi, V)
            dx[:] = 0.0
            if has_a:
                r[0], r[1], r[2] = 0.0, 0.0, 1.0
                _take_vector(x, P, a, r, sigma_a, places[0], places[3], f, J, h, dx, u)
            if has_m:
                _take_vector(x, P, m, m_ref[s], sigma_m, places[2], places[4], f, J, h, dx, u)
            for i in range(n):
                x[i] += dx[i]
            normalise(x)
            if square < np.inf and not bound_worst_case(P, square, A, L, U):
                x[:] = np.nan
            for i in range(4):
                out[k, s, i] = x[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _list_blocks(places, n, dt, constants):  # type: ignore[no-untyped-def]
    """Decay per sample (n,) and added variance per sample (n,) of every state except q."""
    decay, noise = np.ones(n), np.zeros(n)
    for i in range(3):
        if places[0] >= 0:
            decay[places[0] + i] = constants[C_A]
            noise[places[0] + i] = constants[S_A] ** 2 * dt
        if places[1] >= 0:
            noise[places[1] + i] = constants[S_B] ** 2 * dt
        if places[2] >= 0:
            decay[places[2] + i] = constants[C_D]
            noise[places[2] + i] = constants[S_D] ** 2 * dt
        if places[3] >= 0:
            noise[places[3] + i] = constants[S_B_A] ** 2 * dt
        if places[4] >= 0:
            noise[places[4] + i] = constants[S_B_M] ** 2 * dt
    return decay, noise


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def predict_state(x, P, w, dt, sigma_g, b, decay, noise, turn, B, xi, V):  # type: ignore[no-untyped-def]
    """Propagate x (n,) and P (n, n) by one sample of rate w (3,); Nazarahari 2021, eq 26, 28, 39 and 40.

    Parameters
    ----------
    b : first state of the gyroscope bias, −1 without. turn (4, 4), B, xi (4, 3), V (4, n) : work; afterwards
        turn = ∂q⁺/∂q and B = ∂q⁺/∂b.
    """
    n = x.shape[0]
    if b >= 0:
        for i in range(3):
            w[i] -= x[b + i]
    h0, h1, h2, h3 = half_turn(dt * w[0], dt * w[1], dt * w[2])
    turn[0, 0], turn[0, 1], turn[0, 2], turn[0, 3] = h0, -h1, -h2, -h3
    turn[1, 0], turn[1, 1], turn[1, 2], turn[1, 3] = h1, h0, h3, -h2
    turn[2, 0], turn[2, 1], turn[2, 2], turn[2, 3] = h2, -h3, h0, h1
    turn[3, 0], turn[3, 1], turn[3, 2], turn[3, 3] = h3, h2, -h1, h0
    rate_jacobian(x, xi)
    if b >= 0:
        for i in range(4):
            for j in range(3):
                B[i, j] = 0.25 * dt * dt * x[i] * w[j] - 0.5 * dt * xi[i, j]
    # V = rows of q of F P
    for i in range(4):
        for j in range(n):
            V[i, j] = (
                turn[i, 0] * P[0, j] + turn[i, 1] * P[1, j] + turn[i, 2] * P[2, j] + turn[i, 3] * P[3, j]
            )
        if b >= 0:
            for j in range(n):
                V[i, j] += B[i, 0] * P[b, j] + B[i, 1] * P[b + 1, j] + B[i, 2] * P[b + 2, j]
    variance = 0.25 * (dt * sigma_g) ** 2
    for i in range(4):
        for j in range(i + 1):
            total = V[i, 0] * turn[j, 0] + V[i, 1] * turn[j, 1] + V[i, 2] * turn[j, 2] + V[i, 3] * turn[j, 3]
            if b >= 0:
                total += V[i, b] * B[j, 0] + V[i, b + 1] * B[j, 1] + V[i, b + 2] * B[j, 2]
            total += variance * dot(xi[i], xi[j])
            P[i, j] = total
            P[j, i] = total
        for j in range(4, n):
            total = V[i, j] * decay[j]
            P[i, j] = total
            P[j, i] = total
    for i in range(4, n):
        for j in range(4, n):
            P[i, j] *= decay[i] * decay[j]
        P[i, i] += noise[i]
        x[i] *= decay[i]
    x[0], x[1], x[2], x[3] = multiply(x[0], x[1], x[2], x[3], h0, h1, h2, h3)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _take_vector(x, P, v, r, sigma, one, second, f, J, h, dx, u):  # type: ignore[no-untyped-def]
    """Rows v = R(q)ᵀ r + x[one:] + x[other:] (eq 42 to 45), omitting blocks that are −1."""
    to_sensor(x, r, f)
    direction_jacobian(x, r, J)
    for i in range(3):
        residual = v[i] - f[i]
        h[:] = 0.0
        for j in range(4):
            h[j] = J[i, j]
        if one >= 0:
            h[one + i] = 1.0
            residual -= x[one + i]
        if second >= 0:
            h[second + i] = 1.0
            residual -= x[second + i]
        take_scalar(P, h, sigma * sigma, residual, dx, u)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _spread_norms(ring, a, m, has_a, has_m):  # type: ignore[no-untyped-def]
    """Standard deviations of the last norms of accelerometer and magnetometer."""
    slot = int(ring[2 * WINDOW])
    if has_a:
        ring[slot] = np.sqrt(dot(a, a))
    if has_m:
        ring[WINDOW + slot] = np.sqrt(dot(m, m))
    ring[2 * WINDOW] = (slot + 1) % WINDOW
    spread_a, spread_m, mean_a, mean_m = 0.0, 0.0, 0.0, 0.0
    for i in range(WINDOW):
        mean_a += ring[i] / WINDOW
        mean_m += ring[WINDOW + i] / WINDOW
    for i in range(WINDOW):
        spread_a += (ring[i] - mean_a) ** 2 / WINDOW
        spread_m += (ring[WINDOW + i] - mean_m) ** 2 / WINDOW
    return np.sqrt(spread_a), np.sqrt(spread_m)
