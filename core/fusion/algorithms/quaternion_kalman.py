"""Engine E2: linear Kalman filters of the quaternion, with seven ways of constructing its measurement.

The measurement is computed at the predicted quaternion; its noise is R = J Σ Jᵀ + ε 1 with the noise Σ of
accelerometer and magnetometer. Equations: docs/science/filters.md, "E2 Linear Kalman filters".
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import numba
import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.gain_kernel import choose_level, infer_gain
from sagittal.core.fusion.algorithms.gains import LONGEST_WINDOW
from sagittal.core.fusion.algorithms.kalman import take_block
from sagittal.core.fusion.algorithms.vectors import (
    direction_jacobian,
    dot,
    half_turn,
    level,
    normalise,
    observe,
    rate_jacobian,
    read_sample,
    to_sensor,
    unit,
)
from sagittal.core.rotation.compiled import from_matrix, multiply

KINDS: Final = (
    "wahba", "gd_plain", "gd_recursive", "linear", "algebraic", "pseudo", "gd_disturbed"
)  # fmt: skip
"""Measurements; their place here is their number in the compiled loop."""
WAHBA, GD_PLAIN, GD_RECURSIVE, LINEAR, ALGEBRAIC, PSEUDO, GD_DISTURBED = range(7)

GAINS: Final = ("sigma_g", "sigma_a", "sigma_m")
CONSTANTS: Final = ("p0", "mu", "sigma_q", "c_a", "c_d", "s_a", "s_d")

EPS: Final = 1e-10
"""Of R, which has the rank of what was measured (docs/science/filters.md, "Corrections to the texts")."""
EPS_PSEUDO: Final = 1e-6
"""The same of Choukroun 2006."""


def count_states(kind: str) -> int:
    """Number of states with a covariance: q, and a and d if estimated."""
    return 10 if kind == "gd_disturbed" else 4


LEAST_VARIANCE, MOST_VARIANCE = 1e-12, 1e2
"""Of an axis of the gyroscope that adapts, (rad/s)²."""
TAIL: Final = 3 + 4 * LONGEST_WINDOW + 2
"""Floats of state behind the covariance: variance of each axis, window of innovations, two counters."""


def start_state(kind: str, q: Floats, p0: float, variance: float) -> Floats:
    """State (size,) at an orientation q (4,): states, covariance, adaptation."""
    n = count_states(kind)
    tail = np.zeros(TAIL)
    tail[:3] = variance
    return np.concatenate((q, np.zeros(n - 4), (p0 * np.eye(n)).ravel(), tail))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_quaternion_kalman(kind, window, rules, gyr, acc, mag, dt, m_ref, rows, constants, state, out):  # type: ignore[no-untyped-def]
    """Advance S sensors over n samples; arrays as in `run_complementary`, rows of σ_G, σ_A, σ_M.

    Parameters
    ----------
    window, rules : samples and row (42,) for the adaptation of σ_G to the innovations of `wahba`; window 0 =
        none.
    """
    n = 10 if kind == GD_DISTURBED else 4
    w, a, m, work = np.empty(3), np.empty(3), np.empty(3), np.empty((4, 3))
    turn, xi, four = np.empty((4, 4)), np.empty((4, 3)), np.empty((2, 4))
    H, R, S, L, V = np.eye(n), np.zeros((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    y, dx, J = np.empty(n), np.empty(n), np.zeros((n, 6))
    for s in range(gyr.shape[1]):
        x, P, tail = state[s, :n], state[s, n : n + n * n].reshape(n, n), state[s, n + n * n :]
        r, variances = m_ref[s], tail[:3]
        q = x[:4]
        for k in range(gyr.shape[0]):
            has_a, has_m, da, dm, rate = read_sample(gyr, acc, mag, k, s, w, a, m)
            sigma_g = choose_level(rows, 0, da, dm, rate)
            sigma_a = choose_level(rows, 1, da, dm, rate)
            sigma_m = choose_level(rows, 2, da, dm, rate)
            if window == 0:
                variances[:] = sigma_g * sigma_g
            _predict(x, P, w, dt, variances, constants, turn, xi, V)
            dx[:] = 0.0
            if kind == PSEUDO:
                for which in range(2):
                    if (has_a, has_m)[which]:
                        _make_pseudo(q, dx, a if which == 0 else m, r, which, H, y, work[0], four)
                        _spread(xi, q, 0.25 * (sigma_a if which == 0 else sigma_m) ** 2, R)
                        take_block(P, H, R, y, dx, S, L, V)
            elif has_a and has_m and _make(kind, x, a, m, r, constants[1], y, J, xi, work, four):
                _weigh(kind, q, y, J, sigma_a, sigma_m, constants[2], R)
                if window > 0:
                    _adapt(tail, y, P, R, window, rules)
                take_block(P, H, R, y, dx, S, L, V)
            for i in range(n):
                x[i] += dx[i]
            normalise(q)
            for i in range(4):
                out[k, s, i] = q[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _predict(x, P, w, dt, variances, c, turn, xi, V):  # type: ignore[no-untyped-def]
    """Nazarahari 2021, eq 26 to 28, with the closed form of the exponential."""
    n = x.shape[0]
    h0, h1, h2, h3 = half_turn(dt * w[0], dt * w[1], dt * w[2])
    turn[0, 0], turn[0, 1], turn[0, 2], turn[0, 3] = h0, -h1, -h2, -h3
    turn[1, 0], turn[1, 1], turn[1, 2], turn[1, 3] = h1, h0, h3, -h2
    turn[2, 0], turn[2, 1], turn[2, 2], turn[2, 3] = h2, -h3, h0, h1
    turn[3, 0], turn[3, 1], turn[3, 2], turn[3, 3] = h3, h2, -h1, h0
    rate_jacobian(x, xi)
    x[0], x[1], x[2], x[3] = multiply(x[0], x[1], x[2], x[3], h0, h1, h2, h3)
    for i in range(4, n):
        x[i] *= c[3] if i < 7 else c[4]
    # V = F P, then P = V Fᵀ + Q
    for i in range(n):
        for j in range(n):
            if i < 4:
                V[i, j] = (
                    turn[i, 0] * P[0, j] + turn[i, 1] * P[1, j] + turn[i, 2] * P[2, j] + turn[i, 3] * P[3, j]
                )
            else:
                V[i, j] = (c[3] if i < 7 else c[4]) * P[i, j]
    for j in range(n):
        for i in range(j + 1):
            if i < 4 and j < 4:
                total = (
                    V[i, 0] * turn[j, 0] + V[i, 1] * turn[j, 1] + V[i, 2] * turn[j, 2] + V[i, 3] * turn[j, 3]
                )
                for k in range(3):
                    total += 0.25 * dt * dt * variances[k] * xi[i, k] * xi[j, k]
            else:
                total = V[i, j] * (c[3] if j < 7 else c[4])
                if i == j:
                    total += (c[5] if i < 7 else c[6]) ** 2 * dt
            P[i, j] = total
            P[j, i] = total


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _adapt(tail, y, P, R, window, rules):  # type: ignore[no-untyped-def]
    """Adapt the variance of each axis to the innovation y (4,) and its window (Nazarahari 2021, 4.2.2.3).

    There are four innovations but three axes: the first three are used, as in the thesis.
    """
    ring, slot, count = tail[3 : 3 + 4 * LONGEST_WINDOW], int(tail[-2]), min(tail[-1] + 1.0, window)
    for i in range(4):
        ring[4 * slot + i] = y[i]
    tail[-2], tail[-1] = (slot + 1) % window, count
    if count < window:
        return
    for i in range(3):
        square = 0.0
        for k in range(window):
            square += ring[4 * k + i] ** 2 / window
        change = infer_gain(rules, P[i, i] + R[i, i] - square, 0.0, 0.0)
        tail[i] = min(max(tail[i] + change, LEAST_VARIANCE), MOST_VARIANCE)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _make(kind, x, a, m, m_ref, mu, y, J, xi, work, four):  # type: ignore[no-untyped-def]
    """Write measurement − state y (n,) and the measurement's derivative J (n, 6) by a and m.

    Returns
    -------
    False if vertical and field are parallel.
    """
    if kind == GD_DISTURBED:
        _make_disturbed(x, a, m, m_ref, mu, y, J, work, four)
        return True
    up, v, f, r = work[0], work[1], work[2], work[3]
    up[0], up[1], up[2] = 0.0, 0.0, 1.0
    r[0], r[1], r[2] = m_ref[0], m_ref[1], m_ref[2]
    unit(a, v)
    unit(m, f)
    if kind in (WAHBA, GD_RECURSIVE):
        # the dip is measured, so that the field moves the heading only
        r[2] = dot(v, f)
        r[0], r[1] = 0.0, sqrt(max(1.0 - r[2] * r[2], 0.0))
    z, t = four[0], four[1]
    if kind == ALGEBRAIC:
        return _make_algebraic(x[:4], v, f, y, J, xi, z)
    # a as a share of the norm at rest: over a movement its mean points up, that of a unit vector does not
    v[0], v[1], v[2] = a[0], a[1], a[2]
    q = x[:4]
    observe(up, v, q, z)
    observe(r, f, q, t)
    for i in range(4):
        if kind == LINEAR:
            # ½ (W + 1) q with W the mean of both
            y[i] = 0.25 * (z[i] + t[i]) - 0.5 * q[i]
        elif kind != WAHBA:
            y[i] = 2.0 * mu * (z[i] + t[i] - 2.0 * q[i])
    scale = 0.25 if kind == LINEAR else 2.0 * mu
    if kind == WAHBA:
        # z = ¼ (W_a + 1)(W_m + 1) q: t = (W_m + 1) q
        for i in range(4):
            t[i] += q[i]
        observe(up, v, t, z)
        for i in range(4):
            y[i] = 0.25 * (z[i] + t[i]) - q[i]
        scale = 0.25
    for j in range(3):
        v[0], v[1], v[2] = 0.0, 0.0, 0.0
        v[j] = scale
        observe(up, v, t if kind == WAHBA else q, z)
        for i in range(4):
            J[i, j] = z[i]
    for j in range(3):
        v[0], v[1], v[2] = 0.0, 0.0, 0.0
        v[j] = scale
        observe(r, v, q, z)
        if kind == WAHBA:
            observe(up, a, z, t)
            for i in range(4):
                J[i, j + 3] = z[i] + t[i]
        else:
            for i in range(4):
                J[i, j + 3] = z[i]
    return True


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _make_algebraic(q, v, f, y, J, xi, z):  # type: ignore[no-untyped-def]
    """Valenti 2016: the quaternion of vertical v and field f, unit (3,), with its derivative in closed form.

    The rotation θ of sensor axes due to small δa and δm is −a × δa + up (east·δm − (m·up) east·δa)/h, h the
    horizontal length of the field; then δz = ½ Ξ(z) θ.
    """
    R = np.empty((3, 3))
    if not level(v, f, R):
        return False
    from_matrix(R, z)
    sign = 1.0 if z[0] * q[0] + z[1] * q[1] + z[2] * q[2] + z[3] * q[3] >= 0.0 else -1.0
    for i in range(4):
        z[i] *= sign
        y[i] = z[i] - q[i]
    rate_jacobian(z, xi)
    along, perpendicular = dot(f, v), dot(f, R[1])
    for i in range(4):
        # ½ Ξ θ: the row of Ξ times −[a]× is a × row
        row = xi[i]
        up = 0.5 * dot(row, v) / perpendicular
        J[i, 0] = 0.5 * (v[1] * row[2] - v[2] * row[1]) - up * along * R[0, 0]
        J[i, 1] = 0.5 * (v[2] * row[0] - v[0] * row[2]) - up * along * R[0, 1]
        J[i, 2] = 0.5 * (v[0] * row[1] - v[1] * row[0]) - up * along * R[0, 2]
        for j in range(3):
            J[i, j + 3] = up * R[0, j]
    return True


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _make_disturbed(x, a, m, m_ref, mu, y, J, work, four):  # type: ignore[no-untyped-def]
    """Nazarahari 2021, eq 29 to 37, at the predicted state [q, a, d]: z − x = −μ J_fᵀ f."""
    r, f, H = work[0], work[1], np.empty((3, 4))
    y[:] = 0.0
    J[:] = 0.0
    for which in range(2):
        offset = 4 + 3 * which
        if which == 0:
            r[0], r[1], r[2] = 0.0, 0.0, 1.0
        else:
            r[0], r[1], r[2] = m_ref[0], m_ref[1], m_ref[2]
        to_sensor(x, r, f)
        direction_jacobian(x, r, H)
        for i in range(3):
            residual = f[i] + x[offset + i] - (a[i] if which == 0 else m[i])
            for j in range(4):
                y[j] -= mu * H[i, j] * residual
                J[j, 3 * which + i] = mu * H[i, j]
            y[offset + i] -= mu * residual
            J[offset + i, 3 * which + i] = mu


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _weigh(kind, q, y, J, sigma_a, sigma_m, sigma_q, R):  # type: ignore[no-untyped-def]
    """Write R = J Σ Jᵀ + ε 1 (n, n), plus the additional terms of each kind of measurement."""
    n = R.shape[0]
    va, vm = sigma_a * sigma_a, sigma_m * sigma_m
    for i in range(n):
        for j in range(i + 1):
            total = va * (J[i, 0] * J[j, 0] + J[i, 1] * J[j, 1] + J[i, 2] * J[j, 2])
            total += vm * (J[i, 3] * J[j, 3] + J[i, 4] * J[j, 4] + J[i, 5] * J[j, 5])
            if kind == ALGEBRAIC:
                # J has no part along z; without noise there the length of z would pull q to it
                total += (va + vm) * (q[i] + y[i]) * (q[j] + y[j])
            R[i, j] = total
            R[j, i] = total
        R[i, i] += EPS + (sigma_q * sigma_q if kind == LINEAR else 0.0)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _make_pseudo(q, dx, v, m_ref, which, H, y, r, four):  # type: ignore[no-untyped-def]
    """Choukroun 2006: 0 = H q, H = ½ (R(b) − L(r)) of the measured b and its reference r."""
    if which == 0:
        r[0], r[1], r[2] = 0.0, 0.0, 1.0
    else:
        r[0], r[1], r[2] = m_ref[0], m_ref[1], m_ref[2]
    column, z = four[0], four[1]
    for j in range(4):
        column[:] = 0.0
        column[j] = 0.5
        c0, c1, c2, c3 = column[0], column[1], column[2], column[3]
        b0, b1, b2, b3 = multiply(c0, c1, c2, c3, 0.0, v[0], v[1], v[2])
        z[0], z[1], z[2], z[3] = multiply(0.0, r[0], r[1], r[2], c0, c1, c2, c3)
        H[0, j], H[1, j], H[2, j], H[3, j] = b0 - z[0], b1 - z[1], b2 - z[2], b3 - z[3]
    for i in range(4):
        y[i] = 0.0
        for j in range(4):
            y[i] -= H[i, j] * (q[j] + dx[j])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _spread(xi, q, variance, R):  # type: ignore[no-untyped-def]
    """Write variance Ξ(q) Ξ(q)ᵀ + ε 1 (4, 4)."""
    rate_jacobian(q, xi)
    for i in range(4):
        for j in range(4):
            R[i, j] = variance * dot(xi[i], xi[j])
        R[i, i] += EPS_PSEUDO
