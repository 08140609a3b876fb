"""What every update of L7S does with its local error ε ∈ R²⁷: one row, the injection, the reset of P.

X ← X Exp(ε), ε = (ρ_p φ_p ρ_lf φ_lf ρ_rf φ_rf ν_p ν_lf ν_rf). With diagonal R the stacked update of Sy 2021
eq 9–12 equals one row after the other at one linearisation: the correction dx is added up and the residual of
each row is taken at dx (docs/science/erkf.md, "Corrections").
"""

from __future__ import annotations

import numba
import numpy as np

from core.body.se3 import right_jacobian
from core.inner import inner_njit
from core.rotation.compiled import exp_so3, multiply3, orthonormalise

N = 27
"""Length of the error vector."""

VELOCITY = 18
"""Where the velocities begin in it."""


@inner_njit()
def apply_row(P, dx, index, value, residual, variance, gain):  # type: ignore[no-untyped-def]
    """One row of the stacked update: H is `value` (k,) at `index` (k,), else 0; gain (27,) is scratch."""
    total, count = variance, len(index)
    for j in range(N):
        s = 0.0
        for k in range(count):
            s += value[k] * P[index[k], j]
        gain[j] = s
    for k in range(count):
        total += value[k] * gain[index[k]]
        residual -= value[k] * dx[index[k]]
    for i in range(N):
        g = gain[i] / total
        dx[i] += g * residual
        for j in range(i + 1):
            P[i, j] -= g * gain[j]
            P[j, i] = P[i, j]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def inject(R, p, v, dx, work):  # type: ignore[no-untyped-def]
    """X ← X Exp(dx); work is (5, 3, 3) of scratch."""
    for b in range(3):
        rho, phi = dx[6 * b : 6 * b + 3], dx[6 * b + 3 : 6 * b + 6]
        exp_so3(phi, work[0], work[1])
        along = np.empty(3)
        for i in range(3):
            along[i] = work[1, i, 0] * rho[0] + work[1, i, 1] * rho[1] + work[1, i, 2] * rho[2]
        for i in range(3):
            p[b, i] += R[b, i, 0] * along[0] + R[b, i, 1] * along[1] + R[b, i, 2] * along[2]
            v[b, i] += dx[VELOCITY + 3 * b + i]
        multiply3(R[b], work[0], work[2])
        R[b] = work[2]
        orthonormalise(R[b], work[3:5])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def reset(P, dx, work):  # type: ignore[no-untyped-def]
    """P ← Φ(dx) P Φ(dx)ᵀ (eq 12), then symmetric again; work is (7, 3, 3) of scratch."""
    same, cross = work[5], work[6]
    column = np.empty(6)
    for b in range(3):
        at = 6 * b
        right_jacobian(dx[at : at + 3], dx[at + 3 : at + 6], same, cross, work[:5])
        for across in range(2):
            for j in range(N):
                for i in range(6):
                    column[i] = P[at + i, j] if across == 0 else P[j, at + i]
                for i in range(3):
                    rho = phi = 0.0
                    for k in range(3):
                        rho += same[i, k] * column[k] + cross[i, k] * column[3 + k]
                        phi += same[i, k] * column[3 + k]
                    if across == 0:
                        P[at + i, j] = rho
                        P[at + 3 + i, j] = phi
                    else:
                        P[j, at + i] = rho
                        P[j, at + 3 + i] = phi
    for i in range(N):
        for j in range(i):
            mean = 0.5 * (P[i, j] + P[j, i])
            P[i, j] = mean
            P[j, i] = mean
