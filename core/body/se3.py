"""Exponential, logarithm and Jacobians of SO(3) and SE(3) as compiled loops for the filters of this folder.

ξ = (ρ, φ); T Exp(ξ) = (R Exp(φ), p + R J_l(φ) ρ). ad(ξ) = [[φ×, ρ×], [0, φ×]];
Φ(ξ) = Σ (−1)^i/(i+1)! ad(ξ)^i (Sy 2021 eq 8) is the right Jacobian. Every function writes into `out`.
Source: docs/science/l7s.md, "Frames and symbols"; Barfoot 2017, State Estimation for Robotics, §7.
"""

from __future__ import annotations

import numba
import numpy as np

from core.frames import Floats

SMALL = 1e-4
"""Angle in rad below which series of three terms are exact to 1e-16."""

TERMS = 40
"""Terms after which a series has surely ended: the angles are below π."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def skew(a: Floats, out: Floats) -> None:
    """Write a× (3, 3)."""
    out[0, 0], out[0, 1], out[0, 2] = 0.0, -a[2], a[1]
    out[1, 0], out[1, 1], out[1, 2] = a[2], 0.0, -a[0]
    out[2, 0], out[2, 1], out[2, 2] = -a[1], a[0], 0.0


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def multiply3(a: Floats, b: Floats, out: Floats) -> None:
    """Write the product (3, 3); out must be neither a nor b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def exp_so3(phi: Floats, rotation: Floats, jacobian: Floats) -> None:
    """Write Exp(φ) and the left Jacobian J_l(φ), both (3, 3)."""
    x, y, z = phi[0], phi[1], phi[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle < SMALL:
        s = 1.0 - square / 6.0 + square * square / 120.0
        c = 0.5 - square / 24.0
        d = 1.0 / 6.0 - square / 120.0
    else:
        s = np.sin(angle) / angle
        c = (1.0 - np.cos(angle)) / square
        d = (1.0 - s) / square
    for i in range(3):
        for j in range(3):
            outer = phi[i] * phi[j]
            rotation[i, j] = c * outer
            jacobian[i, j] = d * outer
        rotation[i, i] += 1.0 - c * square
        jacobian[i, i] += 1.0 - d * square
    rotation[0, 1] -= s * z
    rotation[0, 2] += s * y
    rotation[1, 0] += s * z
    rotation[1, 2] -= s * x
    rotation[2, 0] -= s * y
    rotation[2, 1] += s * x
    jacobian[0, 1] -= c * z
    jacobian[0, 2] += c * y
    jacobian[1, 0] += c * z
    jacobian[1, 2] -= c * x
    jacobian[2, 0] -= c * y
    jacobian[2, 1] += c * x


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def log_so3(rotation: Floats, out: Floats) -> None:
    """Write the rotation vector (3,), norm ≤ π, by way of the quaternion's largest component."""
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


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def right_jacobian(rho: Floats, phi: Floats, same: Floats, cross: Floats, work: Floats) -> None:
    """Write Φ(ξ) = [[same, cross], [0, same]], blocks (3, 3); work is (5, 3, 3) of scratch.

    The powers of ad keep that form: ad^{i+1} has φ× Aⁱ on the diagonal and φ× Bⁱ + ρ× Aⁱ beside it.
    """
    turn, shift, a, b, c = work[0], work[1], work[2], work[3], work[4]
    skew(phi, turn)
    skew(rho, shift)
    for i in range(3):
        for j in range(3):
            a[i, j] = 1.0 if i == j else 0.0
            b[i, j] = 0.0
            same[i, j] = a[i, j]
            cross[i, j] = 0.0
    factor = 1.0
    for term in range(1, TERMS):
        factor = -factor / (term + 1)
        multiply3(turn, b, c)
        largest = 0.0
        for i in range(3):
            for j in range(3):
                b[i, j] = c[i, j] + shift[i, 0] * a[0, j] + shift[i, 1] * a[1, j] + shift[i, 2] * a[2, j]
                cross[i, j] += factor * b[i, j]
                largest = max(largest, abs(factor * b[i, j]))
        multiply3(turn, a, c)
        for i in range(3):
            for j in range(3):
                a[i, j] = c[i, j]
                same[i, j] += factor * a[i, j]
                largest = max(largest, abs(factor * a[i, j]))
        if largest < 1e-18:
            break


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def orthonormalise(rotation: Floats, work: Floats) -> None:
    """Take rounding out of a rotation (3, 3) in place: R ← R (3 − RᵀR) / 2; work is (2, 3, 3)."""
    gram, copy = work[0], work[1]
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += rotation[k, i] * rotation[k, j]
            gram[i, j] = (1.5 if i == j else 0.0) - 0.5 * total
            copy[i, j] = rotation[i, j]
    multiply3(copy, gram, rotation)
