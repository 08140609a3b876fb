"""The compiled step of L7S: predict, one stacked update, projections; core/body/l7s/filter.py explains it."""

from __future__ import annotations

import numba
import numpy as np

from core.body.l7s.constraints import project
from core.body.l7s.updates import VELOCITY, N, apply_row, inject, reset
from core.frames import Floats
from core.inner import inner_njit
from core.rotation.compiled import log_so3


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def predict(R, p, v, P, acc, dt, q_acc, q_turn, printed):  # type: ignore[no-untyped-def]
    """Move the mean by eq 3–4 with ω = 0 and P by eq 5 (docs/science/l7s.md, "Prediction")."""
    omega = np.empty(3)
    for b in range(3):
        rho, phi, nu = 6 * b, 6 * b + 3, VELOCITY + 3 * b
        Rb = R[b]
        shift = np.empty(3)
        for i in range(3):
            shift[i] = dt * v[b, i] + 0.5 * dt * dt * acc[b, i]
        for i in range(3):
            omega[i] = Rb[0, i] * shift[0] + Rb[1, i] * shift[1] + Rb[2, i] * shift[2]
        x, y, z = omega[0], omega[1], omega[2]
        # F = 1 + Δt Rᵀ at (ρ, ν), and in print [Ω]× at (ρ, φ): rows, then columns
        for j in range(N):
            for i in range(3):
                P[rho + i, j] += dt * (
                    Rb[0, i] * P[nu, j] + Rb[1, i] * P[nu + 1, j] + Rb[2, i] * P[nu + 2, j]
                )
            if printed:
                P[rho, j] += y * P[phi + 2, j] - z * P[phi + 1, j]
                P[rho + 1, j] += z * P[phi, j] - x * P[phi + 2, j]
                P[rho + 2, j] += x * P[phi + 1, j] - y * P[phi, j]
        for j in range(N):
            for i in range(3):
                P[j, rho + i] += dt * (
                    Rb[0, i] * P[j, nu] + Rb[1, i] * P[j, nu + 1] + Rb[2, i] * P[j, nu + 2]
                )
            if printed:
                P[j, rho] += y * P[j, phi + 2] - z * P[j, phi + 1]
                P[j, rho + 1] += z * P[j, phi] - x * P[j, phi + 2]
                P[j, rho + 2] += x * P[j, phi + 1] - y * P[j, phi]
        for i in range(3):
            p[b, i] += shift[i]
            v[b, i] += dt * acc[b, i]
        # Φ(Ω) Q Φ(Ω)ᵀ with Φ(Ω) = 1 − ½ [Ω]× at (ρ, φ)
        square = omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2]
        for i in range(3):
            P[rho + i, rho + i] += 0.25 * (q_acc * dt**4 + q_turn * square)
            P[phi + i, phi + i] += q_turn
            P[nu + i, nu + i] += q_acc * dt * dt
            for j in range(3):
                P[rho + i, rho + j] -= 0.25 * q_turn * omega[i] * omega[j]
                cross = 0.5 * q_acc * dt**3 * Rb[j, i]
                P[rho + i, nu + j] += cross
                P[nu + j, rho + i] += cross
        h = 0.5 * q_turn
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            # −½ q [Ω]×: entry (j, k) of [Ω]× is −Ω_i, entry (k, j) is +Ω_i
            P[rho + j, phi + k] += h * omega[i]
            P[phi + k, rho + j] += h * omega[i]
            P[rho + k, phi + j] -= h * omega[i]
            P[phi + j, rho + k] -= h * omega[i]


@inner_njit()
def _relative(a: Floats, b: Floats, out: Floats) -> None:
    """Write aᵀ b (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]


@inner_njit()
def yaw_row(R, leg, out):  # type: ignore[no-untyped-def]
    """Write J_f (3,) = ∂θ/∂φ of a foot, θ the heading of the feet's summed z axes (eq 22–25)."""
    tx, ty = R[1, 0, 2] + R[2, 0, 2], R[1, 1, 2] + R[2, 1, 2]
    length = tx * tx + ty * ty
    Rf = R[1 + leg]
    # rows x and y of −R_f [ẑ]×
    out[0] = (-tx * Rf[1, 1] + ty * Rf[0, 1]) / length
    out[1] = (tx * Rf[1, 0] - ty * Rf[0, 0]) / length
    out[2] = 0.0


@inner_njit()
def apply_measurement(R, p, v, P, measured, three, step, z_variance, heights, r, dx, work):  # type: ignore[no-untyped-def]
    """The stacked update: leaves the correction in dx and injects it (docs/science/l7s.md, "Measurements").

    heights : pelvis, foot. r : variances (orientation, mid-pelvis, pelvis z, yaw, zero velocity).
    """
    index, value, gain = np.empty(9, np.int64), np.empty(9), np.empty(N)
    phi, rows = np.empty(3), np.empty((2, 3))
    dx[:] = 0.0
    for b in range(0 if three else 1, 3):
        _relative(R[b], measured[b], work[0])
        log_so3(work[0], phi)
        for i in range(3):
            index[0], value[0] = 6 * b + 3 + i, 1.0
            apply_row(P, dx, index[:1], value[:1], phi[i], r[0], gain)
    for axis in range(2):
        for b in range(3):
            share = 1.0 if b == 0 else -0.5
            for i in range(3):
                index[3 * b + i] = 6 * b + i
                value[3 * b + i] = share * R[b, axis, i]
        residual = -(p[0, axis] - 0.5 * p[1, axis] - 0.5 * p[2, axis])
        apply_row(P, dx, index[:9], value[:9], residual, r[1], gain)
    for b in range(3):
        for i in range(3):
            index[i], value[i] = 6 * b + i, R[b, 2, i]
        height, variance = (heights[0], r[2]) if b == 0 else (heights[1], z_variance[b - 1])
        apply_row(P, dx, index[:3], value[:3], height - p[b, 2], variance, gain)
    for leg in range(2):
        if step[leg]:
            for i in range(3):
                index[0], value[0] = VELOCITY + 3 * (1 + leg) + i, 1.0
                apply_row(P, dx, index[:1], value[:1], -v[1 + leg, i], r[4], gain)
    if not three:
        theta = np.arctan2(R[1, 1, 2] + R[2, 1, 2], R[1, 0, 2] + R[2, 0, 2])
        c, s = np.cos(theta), np.sin(theta)
        for i in range(3):
            work[0, i, 0] = R[0, 0, i] * c + R[0, 1, i] * s
            work[0, i, 1] = R[0, 1, i] * c - R[0, 0, i] * s
            work[0, i, 2] = R[0, 2, i]
        log_so3(work[0], phi)
        for leg in range(2):
            yaw_row(R, leg, rows[leg])
        for i in range(3):
            index[0], value[0] = 3 + i, 1.0
            for leg in range(2):
                for k in range(3):
                    index[1 + 3 * leg + k] = 6 * (1 + leg) + 3 + k
                    value[1 + 3 * leg + k] = -R[0, 2, i] * rows[leg, k]
            apply_row(P, dx, index[:7], value[:7], phi[i], r[3], gain)
    inject(R, p, v, dx, work)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_l7s_kernel(  # type: ignore[no-untyped-def]
    R, p, v, P, since, measured, acc, step, three, dt, lengths, heights, r, swing, q, printed, projections,
    R_out, p_out, v_out, variance_out,
):  # fmt: skip
    """Advance the state in place over a block; return the index of the sample that failed, −1 if none did.

    lengths : half hip width, half foot, leg. swing : m² at toe-off, least m², λ s. q : acceleration,
    orientation.
    """
    dx, work, z_variance = np.zeros(N), np.empty((7, 3, 3)), np.empty(2)
    for n in range(measured.shape[0]):
        predict(R, p, v, P, acc[n], dt, q[0], q[1], printed)
        for leg in range(2):
            since[leg] = 0.0 if step[n, leg] else since[leg] + 1.0
            z_variance[leg] = swing[1]
            if not step[n, leg]:
                z_variance[leg] = max(swing[0] * np.exp(-4.0 * since[leg] * dt / swing[2]), swing[1])
        apply_measurement(R, p, v, P, measured[n], three, step[n], z_variance, heights, r, dx, work)
        reset(P, dx, work)
        for _ in range(projections):
            if not project(R, p, v, P, lengths[0], lengths[1], lengths[2], dx, work):
                return n
        R_out[n], p_out[n], v_out[n] = R, p, v
        for i in range(N):
            variance_out[n, i] = P[i, i]
    return -1
