"""Exponential and right Jacobian of SE(3) inside compiled loops, for the filter of L7S.

ξ = (ρ, φ); T Exp(ξ) = (R Exp(φ), p + R J_l(φ) ρ). ad(ξ) = [[φ×, ρ×], [0, φ×]]; Φ(ξ) = Σ (−1)^i/(i+1)! ad(ξ)^i
(Sy 2021 eq 8) is the right Jacobian. Pure rotations: core/rotation/compiled.py. Source: docs/science/l7s.md,
"Frames and symbols"; Barfoot 2017, State Estimation for Robotics, §7.
"""

from __future__ import annotations

from math import factorial, sin, sqrt

import numba

from sagittal.core.rotation.compiled import multiply3, orthonormalise, skew_polynomial
from sagittal.core.signals.inner import UNCOUNTED, inner_njit

SMALL = 0.25
"""Square of the angle up to which seven terms of a series are exact to 1e-17: no sine is needed."""

_A = tuple((-1.0) ** k / factorial(2 * k + 2) for k in range(7))
_B = tuple((-1.0) ** k / factorial(2 * k + 3) for k in range(7))
_SLOPE_A = tuple((-1.0) ** k * 2 * k / factorial(2 * k + 2) for k in range(1, 8))
_SLOPE_B = tuple((-1.0) ** k * 2 * k / factorial(2 * k + 3) for k in range(1, 8))


@inner_njit(**UNCOUNTED)
def _sum_powers(terms, x):  # type: ignore[no-untyped-def]
    total = terms[6]
    for k in range(5, -1, -1):
        total = total * x + terms[k]
    return total


@inner_njit(error_model="numpy", **UNCOUNTED)
def _quotients(square):  # type: ignore[no-untyped-def]
    """a = (1 − cos θ) / θ² and b = (θ − sin θ) / θ³ of an angle θ given as its square."""
    if square < SMALL:
        return _sum_powers(_A, square), _sum_powers(_B, square)
    angle = sqrt(square)
    return 2.0 * (sin(0.5 * angle) / angle) ** 2, (1.0 - sin(angle) / angle) / square


@inner_njit(error_model="numpy", **UNCOUNTED)
def _slopes(square, a, b):  # type: ignore[no-untyped-def]
    """Derivatives of a and b with respect to θ, divided by θ."""
    if square < SMALL:
        return _sum_powers(_SLOPE_A, square), _sum_powers(_SLOPE_B, square)
    return (1.0 - square * b - 2.0 * a) / square, (a - 3.0 * b) / square


@inner_njit(**UNCOUNTED)
def move_pose(R, p, xi, offset, work):  # type: ignore[no-untyped-def]
    """T ← T Exp(ξ) of a pose R (3, 3), p (3,); ξ is xi[offset : at + 6], work (3, 3, 3) of scratch."""
    x, y, z = xi[offset + 3], xi[offset + 4], xi[offset + 5]
    r, s, t = xi[offset], xi[offset + 1], xi[offset + 2]
    square = x * x + y * y + z * z
    a, b = _quotients(square)
    # J_l ρ = ρ + a φ × ρ + b φ × (φ × ρ)
    i, j, k = y * t - z * s, z * r - x * t, x * s - y * r
    r, s, t = (
        r + a * i + b * (y * k - z * j),
        s + a * j + b * (z * i - x * k),
        t + a * k + b * (x * j - y * i),
    )
    for c in range(3):
        p[c] += R[c, 0] * r + R[c, 1] * s + R[c, 2] * t
    turned = work[0]
    skew_polynomial(xi[offset + 3 : offset + 6], 1.0, 1.0 - square * b, a, turned)
    multiply3(R, turned, work[1])
    for i in range(3):
        for j in range(3):
            R[i, j] = work[1, i, j]
    orthonormalise(R, work)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def right_jacobian(xi, offset, same, cross):  # type: ignore[no-untyped-def]
    """Write Φ(ξ) = [[same, cross], [0, same]], blocks (3, 3); ξ is xi[offset : at + 6].

    `same` is J_r(φ) = 1 − a [φ]× + b [φ]×², `cross` its derivative along ρ: the series of Φ differentiated
    term by term, as the off-diagonal block of ad(ξ)^i is the derivative of [φ]×^i.
    """
    x, y, z = xi[offset + 3], xi[offset + 4], xi[offset + 5]
    r, s, t = xi[offset], xi[offset + 1], xi[offset + 2]
    square, along = x * x + y * y + z * z, x * r + y * s + z * t
    a, b = _quotients(square)
    slope_a, slope_b = _slopes(square, a, b)
    skew_polynomial(xi[offset + 3 : offset + 6], 1.0, -a, b, same)
    # −a [ρ]× − slope_a (φ·ρ) [φ]×
    c, d = a, slope_a * along
    i, j, k = c * r + d * x, c * s + d * y, c * t + d * z
    # b (φρᵀ + ρφᵀ − 2 (φ·ρ)) + slope_b (φ·ρ) (φφᵀ − θ²)
    d = slope_b * along
    trace = -2.0 * b * along - d * square
    cross[0, 0] = trace + 2.0 * b * x * r + d * x * x
    cross[1, 1] = trace + 2.0 * b * y * s + d * y * y
    cross[2, 2] = trace + 2.0 * b * z * t + d * z * z
    symmetric = b * (x * s + y * r) + d * x * y
    cross[0, 1], cross[1, 0] = symmetric + k, symmetric - k
    symmetric = b * (x * t + z * r) + d * x * z
    cross[0, 2], cross[2, 0] = symmetric - j, symmetric + j
    symmetric = b * (y * t + z * s) + d * y * z
    cross[1, 2], cross[2, 1] = symmetric + i, symmetric - i
