"""The right Jacobian of SE(3) as a compiled loop, for the filter of L7S.

ξ = (ρ, φ); T Exp(ξ) = (R Exp(φ), p + R J_l(φ) ρ). ad(ξ) = [[φ×, ρ×], [0, φ×]];
Φ(ξ) = Σ (−1)^i/(i+1)! ad(ξ)^i (Sy 2021 eq 8) is the right Jacobian. What turns alone needs:
core/rotation/compiled.py.
Source: docs/science/l7s.md, "Frames and symbols"; Barfoot 2017, State Estimation for Robotics, §7.
"""

from __future__ import annotations

import numba

from core.frames import Floats
from core.rotation.compiled import multiply3, skew

TERMS = 40
"""Terms after which a series has surely ended: the angles are below π."""


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
