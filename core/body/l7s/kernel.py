"""The compiled step of L7S: predict, one stacked update, projections; core/body/l7s/filter.py explains it."""

from __future__ import annotations

import numba
import numpy as np

from sagittal.core.body.l7s.constraints import make_scratch, project
from sagittal.core.body.l7s.updates import VELOCITY, WIDTH, N, apply_rows, inject, make_form, reset
from sagittal.core.rotation.compiled import log_so3
from sagittal.core.signals.inner import UNCOUNTED, inner_njit


@inner_njit(**UNCOUNTED)
def predict(R, p, v, P, acc, dt, q_acc, q_turn, printed, turned, factors, n):  # type: ignore[no-untyped-def]
    """Propagate the mean by eq 3–4 with ω = 0 and P by eq 5 (docs/science/l7s.md, "Prediction").

    turned : (3, 3) scratch for the three Ω; factors : (3, 3, 6) for the rows ρ of F − 1.
    n : 28, unknown to the compiler (`apply_rows`).
    """
    for b in range(3):
        for i in range(3):
            turned[b, i] = 0.0
        for k in range(3):
            shift = dt * v[b, k] + 0.5 * dt * dt * acc[b, k]
            for i in range(3):
                turned[b, i] += R[b, k, i] * shift
                # F = 1 + Δt Rᵀ at (ρ, ν), and in print [Ω]× at (ρ, φ)
                factors[b, i, k] = dt * R[b, k, i]
            p[b, k] += shift
            v[b, k] += dt * acc[b, k]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            factors[b, i, 3 + i] = 0.0
            factors[b, i, 3 + j] = -turned[b, k] if printed else 0.0
            factors[b, i, 3 + k] = turned[b, j] if printed else 0.0
    _add_rows(P, factors, n)
    _add_columns(P, factors)
    # Φ(Ω) Q Φ(Ω)ᵀ with Φ(Ω) = 1 − ½ [Ω]× at (ρ, φ)
    h = 0.5 * q_turn
    for b in range(3):
        omega, rho, phi, nu = turned[b], 6 * b, 6 * b + 3, VELOCITY + 3 * b
        square = omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2]
        for i in range(3):
            P[WIDTH * (rho + i) + rho + i] += 0.25 * (q_acc * dt**4 + q_turn * square)
            P[WIDTH * (phi + i) + phi + i] += q_turn
            P[WIDTH * (nu + i) + nu + i] += q_acc * dt * dt
            for j in range(3):
                P[WIDTH * (rho + i) + rho + j] -= 0.25 * q_turn * omega[i] * omega[j]
                cross = 0.5 * q_acc * dt**3 * R[b, j, i]
                P[WIDTH * (rho + i) + nu + j] += cross
                P[WIDTH * (nu + j) + rho + i] += cross
            # −½ q [Ω]×: entry (j, k) of [Ω]× is −Ω_i, entry (k, j) is +Ω_i
            j, k = (i + 1) % 3, (i + 2) % 3
            P[WIDTH * (rho + j) + phi + k] += h * omega[i]
            P[WIDTH * (phi + k) + rho + j] += h * omega[i]
            P[WIDTH * (rho + k) + phi + j] -= h * omega[i]
            P[WIDTH * (phi + j) + rho + k] -= h * omega[i]


@inner_njit(**UNCOUNTED)
def _add_rows(P, factors, n):  # type: ignore[no-untyped-def]
    """P ← F P; F differs from 1 in the rows ρ and involves ν and φ."""
    for b in range(3):
        pose, nu = P[WIDTH * 6 * b :], P[WIDTH * (VELOCITY + 3 * b) :]
        for i in range(3):
            rho = pose[WIDTH * i :]
            c, d, e = factors[b, i, 0], factors[b, i, 1], factors[b, i, 2]
            f, g, h = factors[b, i, 3], factors[b, i, 4], factors[b, i, 5]
            for j in range(n):
                rho[j] += (
                    c * nu[j] + d * nu[WIDTH + j] + e * nu[2 * WIDTH + j]
                    + f * pose[3 * WIDTH + j] + g * pose[4 * WIDTH + j] + h * pose[5 * WIDTH + j]
                )  # fmt: skip


@inner_njit(**UNCOUNTED)
def _add_columns(P, factors):  # type: ignore[no-untyped-def]
    """P ← P Fᵀ of F times a symmetric matrix: the result is symmetric, so most of it is copied."""
    for b in range(3):
        phi, nu = 6 * b + 3, VELOCITY + 3 * b
        for i in range(3):
            f, column = factors[b, i], 6 * b + i
            for c in range(3):
                for k in range(3):
                    row = WIDTH * (6 * c + k)
                    P[row + column] += (
                        f[0] * P[row + nu] + f[1] * P[row + nu + 1] + f[2] * P[row + nu + 2]
                        + f[3] * P[row + phi] + f[4] * P[row + phi + 1] + f[5] * P[row + phi + 2]
                    )  # fmt: skip
                    # below it φ, and the velocities of a body
                    P[WIDTH * (6 * c + 3 + k) + column] = P[WIDTH * column + 6 * c + 3 + k]
                    P[WIDTH * (VELOCITY + 3 * c + k) + column] = P[WIDTH * column + VELOCITY + 3 * c + k]


@inner_njit(**UNCOUNTED)
def _relative(a, b, out):  # type: ignore[no-untyped-def]
    """Write aᵀ b (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]


@inner_njit(**UNCOUNTED)
def _write_rows(group, R, p, v, measured, z_variance, heights, r, form, turned):  # type: ignore[no-untyped-def]
    """Write three rows of the measurement into `form`; return the number of triples of ε they involve.

    group : 0 to 2 orientation of a body, 3 and 4 zero velocity of a foot, 5 mid-pelvis above the feet and its
    height, 6 heights of the feet, 7 the pelvis orientation from the feet. turned : (3, 3) scratch.
    """
    offsets, H, left, variance, _ = form
    if group == 5:
        for b in range(3):
            offsets[b] = 6 * b
            for axis in range(3):
                share = 1.0 if b == 0 else -0.5 if axis < 2 else 0.0
                for i in range(3):
                    H[axis, 3 * b + i] = share * R[b, axis, i]
        for axis in range(2):
            left[axis], variance[axis] = -(p[0, axis] - 0.5 * p[1, axis] - 0.5 * p[2, axis]), r[1]
        left[2], variance[2] = heights[0] - p[0, 2], r[2]
        return 3
    if group == 6:
        for leg in range(2):
            offsets[leg], left[leg], variance[leg] = (
                6 * (1 + leg),
                heights[1] - p[1 + leg, 2],
                z_variance[leg],
            )
            for i in range(3):
                H[leg, 3 * leg + i], H[1 - leg, 3 * leg + i], H[2, 3 * leg + i] = R[1 + leg, 2, i], 0.0, 0.0
        return 2
    # the others read three numbers of ε, one each
    spread, length = r[0], 0.0
    if group == 7:
        # heading of the feet's summed z axes (eq 22–25)
        offsets[0], spread = 3, r[3]
        tx, ty = R[1, 0, 2] + R[2, 0, 2], R[1, 1, 2] + R[2, 1, 2]
        theta, length = np.arctan2(ty, tx), tx * tx + ty * ty
        c, s = np.cos(theta), np.sin(theta)
        for i in range(3):
            turned[i, 0] = R[0, 0, i] * c + R[0, 1, i] * s
            turned[i, 1] = R[0, 1, i] * c - R[0, 0, i] * s
            turned[i, 2] = R[0, 2, i]
    elif group < 3:
        offsets[0] = 6 * group + 3
        _relative(R[group], measured[group], turned)
    if 3 <= group <= 4:
        offsets[0], spread = VELOCITY + 3 * (group - 2), r[4]
        for i in range(3):
            left[i] = -v[group - 2, i]
    else:
        log_so3(turned, left)
    for m in range(3):
        variance[m] = spread
        for i in range(3):
            H[m, i] = 1.0 if m == i else 0.0
    if group < 7:
        return 1
    for f in range(1, 3):
        offsets[f] = 6 * f + 3
        for i in range(3):
            # rows x and y of −R_f [ẑ]×: ∂θ/∂φ of a foot
            up = -R[0, 2, i] / length
            H[i, 3 * f] = up * (ty * R[f, 0, 1] - tx * R[f, 1, 1])
            H[i, 3 * f + 1] = up * (tx * R[f, 1, 0] - ty * R[f, 0, 0])
            H[i, 3 * f + 2] = 0.0
    return 3


@inner_njit(error_model="numpy", **UNCOUNTED)
def apply_measurement(  # type: ignore[no-untyped-def]
    R, p, v, P, measured, three, step, z_variance, heights, r, dx, form, work
):
    """The stacked update: writes the correction to dx and injects it (docs/science/l7s.md, "Measurements").

    heights : pelvis, foot. r : variances (orientation, mid-pelvis, pelvis z, yaw, zero velocity). form : of
    `make_form`. work : (3, 3, 3) scratch.
    """
    for j in range(len(dx)):
        dx[j] = 0.0
    for group in range(0 if three else 1, 7 if three else 8):
        if 3 <= group <= 4 and not step[group - 3]:
            continue
        triples = _write_rows(group, R, p, v, measured, z_variance, heights, r, form, work[0])
        apply_rows(P, dx, triples, form)
    inject(R, p, v, dx, work)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_l7s_kernel(  # type: ignore[no-untyped-def]
    R, p, v, P, dx, since, measured, acc, step, three, dt, lengths, heights, r, swing, q, printed,
    projections, R_out, p_out, v_out, variance_out,
):  # fmt: skip
    """Advance the state in place over a block; return the index of the sample that failed, or −1.

    P : (784,) as in updates.py. dx : (28,) scratch, passed in so that its length is unknown to the compiler
    (`apply_rows`). lengths : half hip width, half foot, leg. swing : m² at toe-off, least m², λ s.
    q : acceleration, orientation.
    """
    z_variance, form, scratch = np.empty(2), make_form(), make_scratch()
    work, turned, factors, blocks = (
        np.empty((3, 3, 3)), np.empty((3, 3)), np.empty((3, 3, 6)), np.empty((3, 2, 3, 3)),
    )  # fmt: skip
    for n in range(measured.shape[0]):
        predict(R, p, v, P, acc[n], dt, q[0], q[1], printed, turned, factors, len(dx))
        for leg in range(2):
            since[leg] = 0.0 if step[n, leg] else since[leg] + 1.0
            z_variance[leg] = swing[1]
            if not step[n, leg]:
                z_variance[leg] = max(swing[0] * np.exp(-4.0 * since[leg] * dt / swing[2]), swing[1])
        apply_measurement(R, p, v, P, measured[n], three, step[n], z_variance, heights, r, dx, form, work)
        reset(P, dx, blocks)
        for _ in range(projections):
            if not project(R, p, v, P, lengths, dx, scratch):
                return n
        R_out[n], p_out[n], v_out[n] = R, p, v
        for i in range(N):
            variance_out[n, i] = P[(WIDTH + 1) * i]
    return -1
