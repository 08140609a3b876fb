"""Engine E1: one quaternion, integrated from the gyroscope and then corrected by one of twelve correctors.

Every corrector starts from the orientation already propagated to the sample. Equations, and differences from
the papers: docs/science/filters.md, "E1 Complementary filters". Vectors are separate scalars here: they stay
in registers, which halves the time.
"""

from __future__ import annotations

from math import acos, atan2, cos, sin, sqrt
from typing import Final

import numba
import numpy as np

from sagittal.core.fusion.algorithms.gain_kernel import choose_level, is_moving
from sagittal.core.fusion.algorithms.vectors import (
    climb_direction,
    dot,
    half_turn,
    normalise,
    observe_turn,
    read_sample,
    scale_to_unit,
    turn_by,
    turn_to_sensor,
    turn_to_world,
)
from sagittal.core.rotation.compiled import multiply

KINDS: Final = (
    "cross", "hua", "gd", "lm", "lm_c", "justa", "aqua", "tilt_heading", "fcf", "glin", "svd", "invariant",
)  # fmt: skip
"""Correctors; their place here is their number in the compiled loop."""
CROSS, HUA, GD, LM, LM_C, JUSTA, AQUA, TILT_HEADING, FCF, GLIN, SVD, INVARIANT = range(12)

GAINS: Final[dict[str, tuple[str, ...]]] = {
    "cross": ("kp",), "hua": (), "gd": ("beta",), "lm": ("k_a", "k_m"), "lm_c": ("k_a", "k_m"),
    "justa": ("sigma_a", "sigma_m"), "aqua": ("sigma_m",), "tilt_heading": ("mu_a", "mu_m"),
    "fcf": ("gamma_a", "gamma_m"), "glin": ("sigma_g",), "svd": ("w_a", "w_m"), "invariant": (),
}  # fmt: skip
"""Gains that may follow the motion, in the order in which a corrector reads them."""
CONSTANTS: Final[dict[str, tuple[str, ...]]] = {
    "cross": ("ki",), "hua": ("k1", "k2", "k3", "k4", "kb", "delta"), "gd": ("zeta",), "lm": ("beta",),
    "lm_c": ("beta",), "justa": (), "aqua": ("sigma_b", "alpha_a", "e1", "e2", "s_g", "s_a", "s_b"),
    "tilt_heading": (), "fcf": ("thr_a", "thr_m"), "glin": ("w_a", "w_m", "x"), "svd": ("tot",),
    "invariant": ("la", "lc", "ld", "sigma", "n", "o"),
}  # fmt: skip
FRACTIONS: Final = {
    "justa": ("sigma_a", "sigma_m"), "aqua": ("sigma_m", "sigma_b", "alpha_a"),
    "tilt_heading": ("mu_a", "mu_m"), "fcf": ("gamma_a", "gamma_m"), "glin": ("x",), "svd": ("w_a", "w_m"),
}  # fmt: skip
"""Gains that are shares of an error taken out per sample at 100 Hz; at other rates they are converted."""
LEARNS_BIAS: Final = {"cross": ("ki",), "hua": ("k3", "k4", "kb"), "gd": ("zeta",), "invariant": ("sigma",)}
"""Constants set to zero without a magnetometer: the bias about the vertical would run away."""

SIZE: Final = 10
"""Floats of state: q (4), gyroscope bias (3), three of a corrector's own."""
BIAS: Final = 4

DAMPING: Final = 1e-5
"""Of the least squares of `lm` (Fourati 2011)."""
STRAIGHT: Final = 0.9
"""Above this scalar part AQUA interpolates linearly (Valenti 2015, eq 50)."""
MOST_POWERS: Final = 30
"""Of Davenport's matrix; three are enough for weights of 0.01."""
CLOSE: Final = 1e-9
"""A power that changes less is the last: what is left is smaller by the weights."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_complementary(kind, gyr, acc, mag, dt, m_ref, rows, constants, state, out):  # type: ignore[no-untyped-def]
    """Advance S sensors over n samples.

    Parameters
    ----------
    gyr, acc, mag : (n, S, 3) rad/s, and relative to the norm at rest; NaN if missing. m_ref : (S, 3)
    unit field of the world. rows : (g, 42) gains. constants : (c,). state : (S, SIZE). out : (n, S, 4).
    """
    w, a, m = np.empty(3), np.empty(3), np.empty(3)
    g = np.empty(max(rows.shape[0], 2))
    follows = False
    for i in range(rows.shape[0]):
        g[i] = rows[i, 0]
        follows |= is_moving(rows[i])
    for s in range(gyr.shape[1]):
        x, r = state[s], m_ref[s]
        q, b, own = x[0:4], x[4:7], x[7:10]
        for k in range(gyr.shape[0]):
            has_a, has_m, da, dm, rate = read_sample(gyr, acc, mag, k, s, w, a, m)
            if follows:
                for i in range(rows.shape[0]):
                    g[i] = choose_level(rows, i, da, dm, rate)
            turn_by(q, (w[0] - b[0]) * dt, (w[1] - b[1]) * dt, (w[2] - b[2]) * dt)
            if kind == CROSS:
                _cross(q, b, a, m, has_a, has_m, r, g[0], constants[0], dt)
            elif kind == HUA:
                _hua(q, b, a, m, has_a, has_m, r, constants, dt)
            elif kind == GD:
                _gradient(q, b, a, m, has_a, has_m, g[0], constants[0], dt)
            elif kind in (LM, LM_C):
                _least_squares(q, a, m, has_a, has_m, r, g[0], g[1], constants[0] * dt, kind == LM_C)
            elif kind == JUSTA:
                _small_angles(q, a, m, has_a, has_m, r, g[0], g[1])
            elif kind == AQUA:
                _algebraic(q, b, own, w, a, m, has_a, has_m, da, rate, g[0], constants)
            elif kind == TILT_HEADING:
                _tilt_then_heading(q, a, m, has_a, has_m, g[0], g[1])
            elif kind == FCF:
                _fixed_point(q, a, m, has_a, has_m, g, constants)
            elif kind == GLIN:
                _linear(q, a, m, has_a, has_m, r, constants, g[0])
            elif kind == SVD:
                _wahba(q, a, m, has_a, has_m, r, g[0], g[1], constants[0])
            elif kind == INVARIANT:
                _invariant(q, b, own, a, m, has_a, has_m, r, constants, dt)
            normalise(q)
            for i in range(4):
                out[k, s, i] = q[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _cross_to(q, v, x, y, z):  # type: ignore[no-untyped-def]
    """v × R(q)ᵀ (x, y, z): the rotation that aligns a direction of the world with the measured v (3,)."""
    i, j, k = turn_to_sensor(q, x, y, z)
    return v[1] * k - v[2] * j, v[2] * i - v[0] * k, v[0] * j - v[1] * i


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _cross(q, b, a, m, has_a, has_m, r, kp, ki, dt):  # type: ignore[no-untyped-def]
    """Mahony 2008, eq 32 to 34."""
    x, y, z = 0.0, 0.0, 0.0
    if has_a:
        x, y, z = _cross_to(q, a, 0.0, 0.0, 1.0)
    if has_m:
        i, j, k = _cross_to(q, m, r[0], r[1], r[2])
        x, y, z = x + i, y + j, z + k
    turn_by(q, kp * dt * x, kp * dt * y, kp * dt * z)
    b[0], b[1], b[2] = b[0] - ki * dt * x, b[1] - ki * dt * y, b[2] - ki * dt * z


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _hua(q, b, a, m, has_a, has_m, r, c, dt):  # type: ignore[no-untyped-def]
    """Hua 2014: the magnetometer rotates about the estimated vertical only; the bias is bounded."""
    u, v, w = turn_to_sensor(q, 0.0, 0.0, 1.0)
    x, y, z, turn = 0.0, 0.0, 0.0, 0.0
    if has_a:
        x, y, z = a[1] * w - a[2] * v, a[2] * u - a[0] * w, a[0] * v - a[1] * u
    if has_m:
        # v and v̂, unit vectors of the field across the vertical: v × v̂ lies along it
        along = m[0] * u + m[1] * v + m[2] * w
        e, f, g, norm = scale_to_unit(m[0] - along * u, m[1] - along * v, m[2] - along * w)
        if norm > 1e-6:
            north, east, _, _ = scale_to_unit(r[0], r[1], 0.0)
            i, j, k = turn_to_sensor(q, north, east, 0.0)
            turn = u * (f * k - g * j) + v * (g * i - e * k) + w * (e * j - f * i)
    norm = sqrt(dot(b, b))
    held = c[4] * ((1.0 if norm <= c[5] else c[5] / norm) - 1.0)
    b[0] += dt * (held * b[0] - c[2] * x - c[3] * turn * u)
    b[1] += dt * (held * b[1] - c[2] * y - c[3] * turn * v)
    b[2] += dt * (held * b[2] - c[2] * z - c[3] * turn * w)
    h = c[1] * turn
    turn_by(q, (c[0] * x + h * u) * dt, (c[0] * y + h * v) * dt, (c[0] * z + h * w) * dt)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _gradient(q, b, a, m, has_a, has_m, beta, zeta, dt):  # type: ignore[no-untyped-def]
    """Madgwick 2011, eq 25 to 49; the field's direction is taken from the sample itself (eq 45)."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    if has_a:
        u, v, w, _ = scale_to_unit(a[0], a[1], a[2])
        i, j, k = turn_to_sensor(q, 0.0, 0.0, 1.0)
        s0, s1, s2, s3 = climb_direction(q, 0.0, 0.0, 1.0, i - u, j - v, k - w)
    if has_m:
        u, v, w, _ = scale_to_unit(m[0], m[1], m[2])
        i, j, z = turn_to_world(q, u, v, w)
        y = sqrt(i * i + j * j)
        i, j, k = turn_to_sensor(q, 0.0, y, z)
        t0, t1, t2, t3 = climb_direction(q, 0.0, y, z, i - u, j - v, k - w)
        s0, s1, s2, s3 = s0 + t0, s1 + t1, s2 + t2, s3 + t3
    norm = sqrt(s0 * s0 + s1 * s1 + s2 * s2 + s3 * s3)
    if norm == 0.0:
        return
    r = 1.0 / norm
    s0, s1, s2, s3 = s0 * r, s1 * r, s2 * r, s3 * r
    _, x, y, z = multiply(q[0], -q[1], -q[2], -q[3], s0, s1, s2, s3)
    b[0], b[1], b[2] = b[0] + 2.0 * zeta * dt * x, b[1] + 2.0 * zeta * dt * y, b[2] + 2.0 * zeta * dt * z
    c = beta * dt
    q[0], q[1], q[2], q[3] = q[0] - c * s0, q[1] - c * s1, q[2] - c * s2, q[3] - c * s3


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _least_squares(q, a, m, has_a, has_m, ref, k_a, k_m, beta, use_cross):  # type: ignore[no-untyped-def]
    """Fourati 2011 (Levenberg–Marquardt); with `use_cross` a × m instead of m (Michel 2017).

    Both sides of the least squares are weighted by k, so that k = 0 disables a sensor.
    """
    n00, n01, n02, n11, n12, n22 = DAMPING, 0.0, 0.0, DAMPING, 0.0, DAMPING
    g0, g1, g2 = 0.0, 0.0, 0.0
    for which in range(2):
        if (which == 0 and not has_a) or (which == 1 and not (has_m and (has_a or not use_cross))):
            continue
        k = k_a if which == 0 else k_m
        if which == 0:
            u, v, w = turn_to_sensor(q, 0.0, 0.0, 1.0)
            x, y, z = a[0], a[1], a[2]
        elif use_cross:
            # up × m_ref points west in the world; both sides as unit vectors
            west, south, _, _ = scale_to_unit(-ref[1], ref[0], 0.0)
            u, v, w = turn_to_sensor(q, west, south, 0.0)
            x, y, z, _ = scale_to_unit(
                a[1] * m[2] - a[2] * m[1], a[2] * m[0] - a[0] * m[2], a[0] * m[1] - a[1] * m[0]
            )
        else:
            u, v, w = turn_to_sensor(q, ref[0], ref[1], ref[2])
            x, y, z = m[0], m[1], m[2]
        # X = 2 k [v]×: XᵀX = 4 k² (|v|² 1 − v vᵀ), Xᵀ y = −2 k² v × (y − v) = −2 k² v × y
        c = 4.0 * k * k
        square = u * u + v * v + w * w
        n00, n11, n22 = n00 + c * (square - u * u), n11 + c * (square - v * v), n22 + c * (square - w * w)
        n01, n02, n12 = n01 - c * u * v, n02 - c * u * w, n12 - c * v * w
        c = 2.0 * k * k
        g0, g1, g2 = g0 - c * (v * z - w * y), g1 - c * (w * x - u * z), g2 - c * (u * y - v * x)
    c00, c01, c02 = n11 * n22 - n12 * n12, n02 * n12 - n01 * n22, n01 * n12 - n02 * n11
    c11, c12, c22 = n00 * n22 - n02 * n02, n01 * n02 - n00 * n12, n00 * n11 - n01 * n01
    inverse = 2.0 * beta / (n00 * c00 + n01 * c01 + n02 * c02)
    turn_by(
        q,
        inverse * (c00 * g0 + c01 * g1 + c02 * g2),
        inverse * (c01 * g0 + c11 * g1 + c12 * g2),
        inverse * (c02 * g0 + c12 * g1 + c22 * g2),
    )


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _small_angles(q, a, m, has_a, has_m, r, g_a, g_m):  # type: ignore[no-untyped-def]
    """Justa 2020, linear law: (1, ½ σ a × â) and (1, ½ σ m × m̂), applied in sequence."""
    if has_a:
        x, y, z = _cross_to(q, a, 0.0, 0.0, 1.0)
        c = 0.5 * g_a
        q[0], q[1], q[2], q[3] = multiply(q[0], q[1], q[2], q[3], 1.0, c * x, c * y, c * z)
        normalise(q)
    if has_m:
        x, y, z = _cross_to(q, m, r[0], r[1], r[2])
        c = 0.5 * g_m
        q[0], q[1], q[2], q[3] = multiply(q[0], q[1], q[2], q[3], 1.0, c * x, c * y, c * z)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _interpolate(w, x, y, z, share):  # type: ignore[no-untyped-def]
    """A fraction of a rotation (w, x, y, z), w ≥ 0: linear interpolation if it is small, else along the arc.

    The linear result is not normalised.
    """
    if w > STRAIGHT:
        return 1.0 - share + share * w, share * x, share * y, share * z
    angle = acos(min(w, 1.0))
    c = sin(share * angle) / sin(angle)
    return cos(share * angle), c * x, c * y, c * z


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _turn_world(q, w, x, y, z):  # type: ignore[no-untyped-def]
    """q ← (w, x, y, z) ⊗ q."""
    q[0], q[1], q[2], q[3] = multiply(w, x, y, z, q[0], q[1], q[2], q[3])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _halve_heading(q, m):  # type: ignore[no-untyped-def]
    """Cosine and sine of half the rotation about the vertical that makes m (3,) point north (+y)."""
    x, y, _ = turn_to_world(q, m[0], m[1], m[2])
    horizontal = sqrt(x * x + y * y)
    if horizontal == 0.0:
        return 1.0, 0.0
    c = sqrt(0.5 + 0.5 * abs(y) / horizontal)
    s = 0.5 * x / (horizontal * c)
    if y >= 0.0:
        return c, s
    return abs(s), c if x >= 0.0 else -c


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _algebraic(q, b, last, w, a, m, has_a, has_m, deviation, rate, share_m, c):  # type: ignore[no-untyped-def]
    """Valenti 2015 (AQUA): tilt by the shortest arc, then heading, a fraction of each."""
    if has_a:
        u, v, t, _ = scale_to_unit(a[0], a[1], a[2])
        x, y, z = turn_to_world(q, u, v, t)
        if z > -0.999999:
            # the shortest arc from the measured vertical to e₃
            h = sqrt(0.5 * (1.0 + z))
            factor = 1.0
            if deviation > c[2]:
                factor = max(0.0, (c[3] - deviation) / (c[3] - c[2])) if deviation < c[3] else 0.0
            h0, h1, h2, h3 = _interpolate(h, 0.5 * y / h, -0.5 * x / h, 0.0, factor * c[1])
            _turn_world(q, h0, h1, h2, h3)
    if has_m:
        h, s = _halve_heading(q, m)
        h0, _, _, h3 = _interpolate(h, 0.0, 0.0, s, share_m)
        _turn_world(q, h0, 0.0, 0.0, h3)
    change = sqrt((w[0] - last[0]) ** 2 + (w[1] - last[1]) ** 2 + (w[2] - last[2]) ** 2)
    steady = has_a and rate < c[4] and deviation < c[5] and change < c[6]
    for i in range(3):
        if steady:
            b[i] += c[0] * (w[i] - b[i])
        last[i] = w[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _tilt_then_heading(q, a, m, has_a, has_m, share_a, share_m):  # type: ignore[no-untyped-def]
    """Del Rosario 2016 (reconstruction): a fraction of the tilt error, then a fraction of the heading
    error.
    """
    if has_a:
        x, y, z = turn_to_world(q, a[0], a[1], a[2])
        horizontal = sqrt(x * x + y * y)
        if horizontal > 0.0:
            angle = share_a * atan2(horizontal, z) / horizontal
            h0, h1, h2, h3 = half_turn(angle * y, -angle * x, 0.0)
            _turn_world(q, h0, h1, h2, h3)
    if has_m:
        x, y, _ = turn_to_world(q, m[0], m[1], m[2])
        h0, _, _, h3 = half_turn(0.0, 0.0, share_m * atan2(x, y))
        _turn_world(q, h0, 0.0, 0.0, h3)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _move_to(q, w, x, y, z, gain, farthest):  # type: ignore[no-untyped-def]
    """q ← q + gain ((w, x, y, z) − q), unless that is farther away than `farthest`."""
    w, x, y, z = w - q[0], x - q[1], y - q[2], z - q[3]
    if sqrt(w * w + x * x + y * y + z * z) <= farthest:
        q[0], q[1], q[2], q[3] = q[0] + gain * w, q[1] + gain * x, q[2] + gain * y, q[3] + gain * z


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _fixed_point(q, a, m, has_a, has_m, g, c):  # type: ignore[no-untyped-def]
    """Wu 2016 (FCF): q ← q + ½ γ (W − 1) q for the vertical, then for the field, unless too far off."""
    if not has_a:
        return
    h0, h1, h2, h3 = observe_turn(0.0, 0.0, 1.0, a[0], a[1], a[2], q)
    _move_to(q, h0, h1, h2, h3, 0.5 * g[0], c[0])
    if has_m:
        normalise(q)
        # the dip is measured, so that the field moves the heading only
        u, v, w, _ = scale_to_unit(a[0], a[1], a[2])
        x, y, z, _ = scale_to_unit(m[0], m[1], m[2])
        down = u * x + v * y + w * z
        h0, h1, h2, h3 = observe_turn(0.0, sqrt(max(1.0 - down * down, 0.0)), down, x, y, z, q)
        _move_to(q, h0, h1, h2, h3, 0.5 * g[1], c[1])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _linear(q, a, m, has_a, has_m, ref, c, scale):  # type: ignore[no-untyped-def]
    """Wu 2019 (GLeCF): q ← q + ½ X σ (Σ w W − Σ w) q."""
    w, x, y, z, total = 0.0, 0.0, 0.0, 0.0, 0.0
    if has_a:
        h0, h1, h2, h3 = observe_turn(0.0, 0.0, 1.0, a[0], a[1], a[2], q)
        w, x, y, z, total = c[0] * h0, c[0] * h1, c[0] * h2, c[0] * h3, c[0]
    if has_m:
        h0, h1, h2, h3 = observe_turn(ref[0], ref[1], ref[2], m[0], m[1], m[2], q)
        w, x, y, z, total = w + c[1] * h0, x + c[1] * h1, y + c[1] * h2, z + c[1] * h3, total + c[1]
    h = 0.5 * c[2] * scale
    q[0], q[1] = q[0] + h * (w - total * q[0]), q[1] + h * (x - total * q[1])
    q[2], q[3] = q[2] + h * (y - total * q[2]), q[3] + h * (z - total * q[3])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _wahba(q, a, m, has_a, has_m, ref, w_a, w_m, total):  # type: ignore[no-untyped-def]
    """Marantos 2016 (reconstruction): the rotation closest to a weighted sum of prediction and references.

    Its quaternion is the first eigenvector of Davenport's matrix K = 4 w (q qᵀ) + w_a W_a + w_m W_m (+ a
    multiple of 1), w the weight of the prediction: found by power iteration, each step converging by (w_a +
    w_m) / w.
    """
    w_a, w_m = w_a if has_a else 0.0, w_m if has_m else 0.0
    held = 4.0 * (total - w_a - w_m)
    # keeps the eigenvalues of W, which come in pairs ±, from being the largest in size
    lift = w_a * sqrt(dot(a, a)) if has_a else 0.0
    lift += w_m * sqrt(dot(m, m)) if has_m else 0.0
    x = (q[0], q[1], q[2], q[3])
    for _ in range(MOST_POWERS):
        along = held * (q[0] * x[0] + q[1] * x[1] + q[2] * x[2] + q[3] * x[3])
        h0, h1, h2, h3 = along * q[0], along * q[1], along * q[2], along * q[3]
        h0, h1, h2, h3 = h0 + lift * x[0], h1 + lift * x[1], h2 + lift * x[2], h3 + lift * x[3]
        if has_a:
            t0, t1, t2, t3 = observe_turn(0.0, 0.0, w_a, a[0], a[1], a[2], x)
            h0, h1, h2, h3 = h0 + t0, h1 + t1, h2 + t2, h3 + t3
        if has_m:
            t0, t1, t2, t3 = observe_turn(w_m * ref[0], w_m * ref[1], w_m * ref[2], m[0], m[1], m[2], x)
            h0, h1, h2, h3 = h0 + t0, h1 + t1, h2 + t2, h3 + t3
        square = h0 * h0 + h1 * h1 + h2 * h2 + h3 * h3
        if square == 0.0:
            return
        r = 1.0 / sqrt(square)
        h0, h1, h2, h3 = h0 * r, h1 * r, h2 * r, h3 * r
        change = abs(h0 - x[0]) + abs(h1 - x[1]) + abs(h2 - x[2]) + abs(h3 - x[3])
        x = (h0, h1, h2, h3)
        if change < CLOSE:
            break
    q[0], q[1], q[2], q[3] = x


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _invariant(q, b, scales, a, m, has_a, has_m, ref, c, dt):  # type: ignore[no-untyped-def]
    """Martin and Salaün 2010: errors in the world of a, c = a × m and d = c × a, with scales of a and c."""
    if scales[0] == 0.0:
        # not started: as long as at rest
        scales[0], scales[1] = 1.0, sqrt(ref[0] * ref[0] + ref[1] * ref[1])
    x, y, z, change_a, change_c = 0.0, 0.0, 0.0, 0.0, 0.0
    if has_a:
        # e₃ × (e₃ − a / scale), and so on
        i, j, k = turn_to_world(q, a[0], a[1], a[2])
        r = 1.0 / scales[0]
        x, y = c[0] * r * j, -c[0] * r * i
        change_a = -c[0] * (1.0 - k * r)
        if has_m:
            u, v, w = a[1] * m[2] - a[2] * m[1], a[2] * m[0] - a[0] * m[2], a[0] * m[1] - a[1] * m[0]
            north, east, _, _ = scale_to_unit(ref[0], ref[1], 0.0)
            west, south = -east, north
            i, j, k = turn_to_world(q, u, v, w)
            r = 1.0 / scales[1]
            x, y, z = x - c[1] * south * k * r, y + c[1] * west * k * r, z - c[1] * (west * j - south * i) * r
            change_c = -c[1] * (1.0 - (west * i + south * j) * r)
            # north, where c points west
            i, j, k = turn_to_world(q, v * a[2] - w * a[1], w * a[0] - u * a[2], u * a[1] - v * a[0])
            r = 1.0 / (scales[0] * scales[1])
            x, y, z = x - c[2] * east * k * r, y + c[2] * north * k * r, z - c[2] * (north * j - east * i) * r
            along = c[2] * (1.0 - (north * i + east * j) * r)
            change_a, change_c = change_a - along, change_c - along
    x, y, z = turn_to_sensor(q, x, y, z)
    turn_by(q, 2.0 * dt * x, 2.0 * dt * y, 2.0 * dt * z)
    b[0], b[1], b[2] = b[0] - c[3] * dt * x, b[1] - c[3] * dt * y, b[2] - c[3] * dt * z
    scales[0] *= 1.0 + dt * c[4] * change_a
    scales[1] *= 1.0 + dt * c[5] * change_c
