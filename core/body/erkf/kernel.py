"""The compiled loops of the ErKF: forward over a block of samples, and back over it for the smoother.

One forward function serves live blocks, whole recordings and the smoother's second pass, so all give the same
bits. What the smoother needs is written to a `Record`; without one the same slot is overwritten every sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from core.body.erkf.predict import back, move, propagate, reset_before
from core.body.erkf.updates import (
    GYRO_BIAS,
    VELOCITY,
    back_correct,
    bent,
    correct,
    heading_rows,
    joint_rows,
    known_rows,
    tilt_rows,
)
from core.frames import Bools, Floats
from core.rotation.compiled import to_matrix, turn

INVALID, CONTACT, STILL = 1, 2, 4
"""Bits of a sample's flags."""


class Record(NamedTuple):
    """What one segment of the forward pass leaves for the backward pass; K samples or 1.

    F (K, n, 5, 3, 3) · V (K, B, 3, N) · E (K, B, 9) · H (K, B, 2, 3, 3) · place (K, B, 4) · blocks (K,) ·
    P (K, N, N) after the updates · dx (K, N) injected.
    """

    F: Floats
    V: Floats
    E: Floats
    H: Floats
    place: Floats
    blocks: Floats
    P: Floats
    dx: Floats


class Noise(NamedTuple):
    """Scalars of `ErkfParams`, negative where a correction is off."""

    m: int
    first: float
    impact: float
    gyr_walk: float
    acc_walk: float
    zero_velocity: float
    gate: float
    reaccept: int
    reaccept_m: float
    tilt: float
    centre: float
    axis: float
    zaru: float
    heading: float
    gap_acc: float
    gap_gyr: float


class Links(NamedTuple):
    """The tree: ends (J, 2), lever (J, 2, 3), axis (J, 2, 3), hinged (J,), forward (n, 3); sd (n, 2) σ_a,
    σ_ω."""

    ends: NDArray[np.int64]
    lever: Floats
    axis: Floats
    hinged: Bools
    forward: Floats
    sd: Floats


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def passes(P, b, v, sd, gate):  # type: ignore[no-untyped-def]
    """vᵀ S⁻¹ v ≤ gate for the zero velocity of the IMU whose errors begin at b."""
    S = P[b + 3 : b + 6, b + 3 : b + 6]
    a, d, f = S[0, 0] + sd * sd, S[1, 1] + sd * sd, S[2, 2] + sd * sd
    p, q, r = S[1, 0], S[2, 0], S[2, 1]
    c0, c1, c2 = d * f - r * r, q * r - p * f, p * r - q * d
    det = a * c0 + p * c1 + q * c2
    s = v[0] * (c0 * v[0] + c1 * v[1] + c2 * v[2])
    s += v[1] * (c1 * v[0] + (a * f - q * q) * v[1] + (p * q - a * r) * v[2])
    s += v[2] * (c2 * v[0] + (p * q - a * r) * v[1] + (a * d - p * p) * v[2])
    return s <= gate * det


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def forward(  # type: ignore[no-untyped-def]
    x, P, before, dx, refused, step, acc, gyr, flags, heading, links, noise, record, out, sd, residual, hit
):
    """Filter a block in place; sample at which the covariance broke, or −1."""
    T, n = flags.shape
    m, N = noise.m, P.shape[0]
    J = links.ends.shape[0]
    stride = 1 if record.V.shape[0] > 1 else 0
    R, U, y = np.empty((n, 3, 3)), np.empty((4, 3)), np.empty(3)
    scratch, zero = np.empty((10, 3)), np.zeros(3)
    take, slack = np.zeros(n, np.bool_), np.empty(J)
    for k in range(T):
        slot, dt = stride * k, step[k]
        F, V, E, H = record.F[slot], record.V[slot], record.E[slot], record.H[slot]
        place = record.place[slot]
        for i in range(n):
            move(x[i], before[i], acc[k, i], gyr[k, i], dt, noise.first, R[i], F[i], scratch)
            reset_before(F[i], dx[i * m + 6 : i * m + 9])
        propagate(P, F, m, dt)
        for i in range(n):
            b = i * m
            jump = 0.0
            for c in range(3):
                jump += (acc[k, i, c] - before[i, c]) ** 2
            va = links.sd[i, 0] ** 2 + noise.impact**2 * jump
            vw = links.sd[i, 1] ** 2
            if flags[k, i] & INVALID:
                va, vw = noise.gap_acc**2, noise.gap_gyr**2
            for c in range(3):
                P[b + 3 + c, b + 3 + c] += va * dt * dt
                P[b + 6 + c, b + 6 + c] += vw * dt * dt
                if m == 15:
                    P[b + 9 + c, b + 9 + c] += noise.gyr_walk**2 * dt
                    P[b + 12 + c, b + 12 + c] += noise.acc_walk**2 * dt
                before[i, c] = acc[k, i, c]
                before[i, 3 + c] = gyr[k, i, c]
        # contacts are judged from the predicted state, before any block, so that the order does not matter
        for i in range(n):
            take[i] = False
            hit[k, i] = False
            if not flags[k, i] & CONTACT or noise.zero_velocity < 0.0:
                refused[i] = 0
                continue
            b, v = i * m, x[i, 3:6]
            take[i] = noise.gate < 0.0 or passes(P, b, v, noise.zero_velocity, noise.gate)
            hit[k, i] = not take[i]
            refused[i] = 0 if take[i] else refused[i] + 1
            if refused[i] >= noise.reaccept:
                take[i] = True
                speed2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
                for c in range(3):
                    P[b + c, b + c] += noise.reaccept_m**2
                    P[b + 3 + c, b + 3 + c] += speed2
        # all from the predicted covariance too
        for j in range(J):
            a, c = links.ends[j, 0], links.ends[j, 1]
            slack[j] = np.sqrt(
                max(noise.centre, 0.0) ** 2 + bent(P, R, m, a, c, links.lever[j, 0], links.lever[j, 1])
            )
        dx[:] = 0.0
        B = 0
        good = True
        for j in range(J):
            a, c = links.ends[j, 0], links.ends[j, 1]
            for axis in range(2):
                if (noise.axis if axis else noise.centre) < 0.0 or (axis and not links.hinged[j]):
                    continue
                s = noise.axis if axis else slack[j]
                on = links.axis[j] if axis else links.lever[j]
                joint_rows(x, R, m, a, c, on[0], on[1], axis == 0, place[B], H[B], y)
                good &= correct(P, dx, place[B], H[B], y, s, V[B], E[B], U)
                B += 1
        for i in range(n):
            if take[i]:
                known_rows(place[B], m, i, VELOCITY, x[i, 3:6], zero, y)
                good &= correct(P, dx, place[B], H[B], y, noise.zero_velocity, V[B], E[B], U)
                B += 1
            if noise.tilt > 0.0 and (take[i] or flags[k, i] & STILL):
                tilt_rows(R[i], acc[k, i], m, i, place[B], H[B], y)
                good &= correct(P, dx, place[B], H[B], y, noise.tilt, V[B], E[B], U)
                B += 1
            if noise.zaru > 0.0 and m == 15 and flags[k, i] & STILL:
                known_rows(place[B], m, i, GYRO_BIAS, x[i, 10:13], gyr[k, i], y)
                good &= correct(P, dx, place[B], H[B], y, noise.zaru, V[B], E[B], U)
                B += 1
            # nested: heading_rows writes the block and may only run where a heading was measured
            if heading.shape[0] > 0 and np.isfinite(heading[k, i]):  # noqa: SIM102
                if heading_rows(R[i], links.forward[i], heading[k, i], m, i, place[B], H[B], y):
                    good &= correct(P, dx, place[B], H[B], y, noise.heading, V[B], E[B], U)
                    B += 1
        record.blocks[slot] = B
        for i in range(n):
            b = i * m
            for c in range(3):
                x[i, c] += dx[b + c]
                x[i, 3 + c] += dx[b + 3 + c]
                if m == 15:
                    x[i, 10 + c] += dx[b + 9 + c]
                    x[i, 13 + c] += dx[b + 12 + c]
            turn(x[i, 6:10], dx[b + 6], dx[b + 7], dx[b + 8])
            to_matrix(x[i, 6:10], R[i])
            var = 0.0
            for c in range(3):
                for e in range(3):
                    var += R[i, 2, c] * P[b + 6 + c, b + 6 + e] * R[i, 2, e]
            sd[k, i] = np.sqrt(max(var, 0.0))
            out[k, i] = x[i]
        for r in range(N):
            good &= P[r, r] > 0.0 and abs(dx[r]) < 1e9
        if not good:
            return k
        for j in range(J):
            joint_rows(
                x, R, m, links.ends[j, 0], links.ends[j, 1], links.lever[j, 0], links.lever[j, 1], True,
                place[B], H[B], y,
            )  # fmt: skip
            residual[k, j] = np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2)
        if stride:
            record.P[slot] = P
            record.dx[slot] = dx
    return -1


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def backward(lam, step, record, m, out):  # type: ignore[no-untyped-def]
    """Sweep λ (N,) back over a recorded segment and turn its filtered states `out` into smoothed ones."""
    T, n = out.shape[0], out.shape[1]
    d = np.empty(len(lam))
    for k in range(T - 1, -1, -1):
        P, dx = record.P[k], record.dx[k]
        for r in range(len(lam)):
            s = 0.0
            for c in range(len(lam)):
                s += P[r, c] * lam[c]
            d[r] = -s
        for i in range(n):
            b, x = i * m, out[k, i]
            for c in range(3):
                x[c] += d[b + c]
                x[3 + c] += d[b + 3 + c]
                if m == 15:
                    x[10 + c] += d[b + 9 + c]
                    x[13 + c] += d[b + 12 + c]
            # P and λ are those before the reset; the state is the one after it: δθ ← G δθ
            a0, a1, a2 = 0.5 * dx[b + 6], 0.5 * dx[b + 7], 0.5 * dx[b + 8]
            t0, t1, t2 = d[b + 6], d[b + 7], d[b + 8]
            turn(x[6:10], t0 - (a1 * t2 - a2 * t1), t1 - (a2 * t0 - a0 * t2), t2 - (a0 * t1 - a1 * t0))
        for B in range(record.blocks[k] - 1, -1, -1):
            back_correct(lam, record.place[k, B], record.H[k, B], record.V[k, B], record.E[k, B])
        back(lam, record.F[k], m, step[k])
