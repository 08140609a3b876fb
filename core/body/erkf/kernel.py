"""The compiled loops of the ErKF: forward over a block of samples, and back over it for the smoother.

A sample is one `advance`: predict, add noise, judge contacts, correct, inject. It serves live blocks, whole
recordings and the smoother's second pass, so all give the same bits. What the smoother needs is written to a
`SmootherRecord`; without one the same slot is overwritten every sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from core.body.erkf.predict import move, propagate, propagate_back, reset_before
from core.body.erkf.updates import (
    back_correct,
    heading_rows,
    joint_rows,
    second_order_variance,
    take_block,
    tilt_rows,
    velocity_rows,
)
from core.frames import Bools, Floats
from core.rotation.compiled import to_matrix, turn

INVALID, CONTACT, STILL, PATCHED = 1, 2, 4, 8
"""Bits of a sample's flags."""


class SmootherRecord(NamedTuple):
    """What one segment of the forward pass leaves for the backward pass; K samples or 1.

    F (K, n, 5, 3, 3) · V (K, B, 3, N) · E (K, B, 9) · H (K, B, 2, 3, 3) · place (K, B, 4) · blocks (K,) ·
    P (K, N, N) after the updates, on and below the diagonal · dx (K, N) injected.
    """

    F: Floats
    V: Floats
    E: Floats
    H: Floats
    place: NDArray[np.int64]
    blocks: NDArray[np.int64]
    P: Floats
    dx: Floats


class ErkfMemory(NamedTuple):
    """What passes from one sample to the next, advanced in place: `ErkfState` as the kernels take it.

    x (n, 16) · P (N, N) · before (n, 6) · dx (N,) injected last · refused (n,).
    """

    x: Floats
    P: Floats
    before: Floats
    dx: Floats
    refused: NDArray[np.int64]


class ErkfSamples(NamedTuple):
    """A block: step (T,) s · acc, gyr (T, n, 3) · flags (T, n) · heading (T, n), or (0, n) for none ·
    rolling (T, n) speed in m/s that a foot in contact may have beyond σ_v, or (0, n) for none."""

    step: Floats
    acc: Floats
    gyr: Floats
    flags: NDArray[np.int64]
    heading: Floats
    rolling: Floats


class ErkfOutput(NamedTuple):
    """What a block gives: nominal (T, n, 16) · heading_sd (T, n) · residual (T, J) · refused (T, n)."""

    nominal: Floats
    heading_sd: Floats
    residual: Floats
    refused: Bools

    def part(self, first: int, past: int) -> ErkfOutput:
        """Where samples first … past − 1 are written."""
        k = slice(first, past)
        return ErkfOutput(self.nominal[k], self.heading_sd[k], self.residual[k], self.refused[k])


class ErkfScratch(NamedTuple):
    """R (n, 3, 3) of the IMUs · U (4, 3), y (3,), place (4,), H (2, 3, 3) of a block · vectors (10, 3) ·
    taken (n,) zero velocities, their σ (n,) · slack (J,) m of the joint centres."""

    R: Floats
    U: Floats
    y: Floats
    vectors: Floats
    taken: Bools
    zero_velocity: Floats
    slack: Floats
    place: NDArray[np.int64]
    H: Floats


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
    heading: float
    gap_acc: float
    gap_gyr: float
    patch_acc: float
    patch_gyr: float


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
def is_within_gate(P, b, v, sd, gate):  # type: ignore[no-untyped-def]
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


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def predict(memory, samples, k, noise, scratch, F):  # type: ignore[no-untyped-def]
    """Move every IMU and the covariance over the time before sample k; F (n, 5, 3, 3) is kept."""
    x, before, dx, acc, gyr = memory.x, memory.before, memory.dx, samples.acc, samples.gyr
    R, vectors, m, dt = scratch.R, scratch.vectors, noise.m, samples.step[k]
    for i in range(F.shape[0]):
        move(x[i], before[i], acc[k, i], gyr[k, i], dt, noise.first, R[i], F[i], vectors)
        reset_before(F[i], dx[i * m + 6 : i * m + 9])
    propagate(memory.P, F, m, dt)


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def add_noise(memory, samples, k, links, noise):  # type: ignore[no-untyped-def]
    """Add the process noise of sample k, and make that the last sample."""
    P, before, dt = memory.P, memory.before, samples.step[k]
    acc, gyr, flags, sd = samples.acc, samples.gyr, samples.flags, links.sd
    for i in range(before.shape[0]):
        b = i * noise.m
        jump = 0.0
        for c in range(3):
            jump += (acc[k, i, c] - before[i, c]) ** 2
        va = sd[i, 0] ** 2 + noise.impact**2 * jump
        vw = sd[i, 1] ** 2
        if flags[k, i] & INVALID:
            va, vw = noise.gap_acc**2, noise.gap_gyr**2
        elif flags[k, i] & PATCHED:
            va, vw = va + noise.patch_acc**2, vw + noise.patch_gyr**2
        for c in range(3):
            P[b + 3 + c, b + 3 + c] += va * dt * dt
            P[b + 6 + c, b + 6 + c] += vw * dt * dt
            if noise.m == 15:
                P[b + 9 + c, b + 9 + c] += noise.gyr_walk**2 * dt
                P[b + 12 + c, b + 12 + c] += noise.acc_walk**2 * dt
            before[i, c] = acc[k, i, c]
            before[i, 3 + c] = gyr[k, i, c]


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def judge_contacts(memory, samples, k, noise, scratch, refused):  # type: ignore[no-untyped-def]
    """Write for sample k how far each zero velocity is believed, which are taken and which the gate refuses.

    All are judged from the predicted state, before any block, so that the order does not matter.
    """
    P, x, count = memory.P, memory.x, memory.refused
    flags, taken, sd = samples.flags[k], scratch.taken, scratch.zero_velocity
    for i in range(flags.shape[0]):
        taken[i] = False
        refused[i] = False
        if not flags[i] & CONTACT or noise.zero_velocity < 0.0:
            count[i] = 0
            continue
        b, v = i * noise.m, x[i, 3:6]
        sd[i] = noise.zero_velocity
        if samples.rolling.shape[0] > 0:
            sd[i] = np.sqrt(sd[i] ** 2 + samples.rolling[k, i] ** 2)
        taken[i] = noise.gate < 0.0 or is_within_gate(P, b, v, sd[i], noise.gate)
        refused[i] = not taken[i]
        count[i] = 0 if taken[i] else count[i] + 1
        if count[i] >= noise.reaccept:
            taken[i] = True
            speed2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
            for c in range(3):
                P[b + c, b + c] += noise.reaccept_m**2
                P[b + 3 + c, b + 3 + c] += speed2


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def correct(memory, samples, k, links, noise, scratch, record, slot):  # type: ignore[no-untyped-def]
    """Take all blocks of sample k into the covariance and the correction; False if one is not positive."""
    x, P, dx, R, y, U = memory.x, memory.P, memory.dx, scratch.R, scratch.y, scratch.U
    place, H, V, E = record.place[slot], record.H[slot], record.V[slot], record.E[slot]
    m = noise.m
    # from the predicted covariance, as the contacts
    for j in range(links.ends.shape[0]):
        a, c = links.ends[j, 0], links.ends[j, 1]
        scratch.slack[j] = np.sqrt(
            max(noise.centre, 0.0) ** 2
            + second_order_variance(P, R, m, a, c, links.lever[j, 0], links.lever[j, 1])
        )
    dx[:] = 0.0
    B = 0
    good = True
    for j in range(links.ends.shape[0]):
        a, c = links.ends[j, 0], links.ends[j, 1]
        for axis in range(2):
            if (noise.axis if axis else noise.centre) < 0.0 or (axis and not links.hinged[j]):
                continue
            sd = noise.axis if axis else scratch.slack[j]
            on = links.axis[j] if axis else links.lever[j]
            joint_rows(x, R, m, a, c, on[0], on[1], axis == 0, place[B], H[B], y)
            good &= take_block(P, dx, place[B], H[B], y, sd, V[B], E[B], U)
            B += 1
    for i in range(x.shape[0]):
        rests = samples.flags[k, i] & STILL
        if scratch.taken[i]:
            velocity_rows(x[i, 3:6], m, i, place[B], y)
            good &= take_block(P, dx, place[B], H[B], y, scratch.zero_velocity[i], V[B], E[B], U)
            B += 1
        if noise.tilt > 0.0 and (scratch.taken[i] or rests):
            tilt_rows(R[i], samples.acc[k, i], m, i, place[B], H[B], y)
            good &= take_block(P, dx, place[B], H[B], y, noise.tilt, V[B], E[B], U)
            B += 1
        # nested: heading_rows writes the block and may only run where a heading was measured
        if samples.heading.shape[0] > 0 and np.isfinite(samples.heading[k, i]):  # noqa: SIM102
            if heading_rows(R[i], links.forward[i], samples.heading[k, i], m, i, place[B], H[B], y):
                good &= take_block(P, dx, place[B], H[B], y, noise.heading, V[B], E[B], U)
                B += 1
    record.blocks[slot] = B
    return good


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def inject(memory, noise, scratch, nominal, heading_sd):  # type: ignore[no-untyped-def]
    """Move the correction into the state, and write that (n, 16) and its headings' deviations (n,)."""
    x, P, dx, R = memory.x, memory.P, memory.dx, scratch.R
    for i in range(x.shape[0]):
        b = i * noise.m
        for c in range(3):
            x[i, c] += dx[b + c]
            x[i, 3 + c] += dx[b + 3 + c]
            if noise.m == 15:
                x[i, 10 + c] += dx[b + 9 + c]
                x[i, 13 + c] += dx[b + 12 + c]
        turn(x[i, 6:10], dx[b + 6], dx[b + 7], dx[b + 8])
        to_matrix(x[i, 6:10], R[i])
        var = 0.0
        for c in range(3):
            for e in range(3):
                var += R[i, 2, c] * P[b + 6 + max(c, e), b + 6 + min(c, e)] * R[i, 2, e]
        heading_sd[i] = np.sqrt(max(var, 0.0))
        nominal[i] = x[i]


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def measure_joints(memory, links, noise, scratch, residual):  # type: ignore[no-untyped-def]
    """Write how far the two ends of each joint are apart (J,), m."""
    y = scratch.y
    for j in range(residual.shape[0]):
        a, c = links.ends[j, 0], links.ends[j, 1]
        joint_rows(
            memory.x, scratch.R, noise.m, a, c, links.lever[j, 0], links.lever[j, 1], True, scratch.place,
            scratch.H, y,
        )  # fmt: skip
        residual[j] = np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2)


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def advance(memory, samples, k, links, noise, scratch, record, slot, output):  # type: ignore[no-untyped-def]
    """Filter sample k of a block: the one rule of a file and a stream; False if the covariance broke."""
    predict(memory, samples, k, noise, scratch, record.F[slot])
    add_noise(memory, samples, k, links, noise)
    judge_contacts(memory, samples, k, noise, scratch, output.refused[k])
    good = correct(memory, samples, k, links, noise, scratch, record, slot)
    inject(memory, noise, scratch, output.nominal[k], output.heading_sd[k])
    for r in range(memory.dx.shape[0]):
        good &= memory.P[r, r] > 0.0 and abs(memory.dx[r]) < 1e9
    if good:
        measure_joints(memory, links, noise, scratch, output.residual[k])
    return good


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def filter_forward(memory, samples, links, noise, record, output):  # type: ignore[no-untyped-def]
    """Filter a block, `memory` in place; sample at which the covariance broke, or −1.

    All are given as plain tuples: numba looks at the fields of a named one anew in every call, 0.3 µs each.
    """
    memory = ErkfMemory(*memory)
    samples = ErkfSamples(*samples)
    links = Links(*links)
    noise = Noise(*noise)
    record = SmootherRecord(*record)
    output = ErkfOutput(*output)
    n, J = memory.x.shape[0], links.ends.shape[0]
    scratch = ErkfScratch(
        np.empty((n, 3, 3)), np.empty((4, 3)), np.empty(3), np.empty((10, 3)),
        np.zeros(n, np.bool_), np.empty(n), np.empty(J), np.empty(4, np.int64), np.empty((2, 3, 3)),
    )  # fmt: skip
    keeps = record.V.shape[0] > 1
    for k in range(samples.step.shape[0]):
        slot = k if keeps else 0
        if not advance(memory, samples, k, links, noise, scratch, record, slot, output):
            return k
        if keeps:
            for r in range(memory.P.shape[0]):
                record.P[slot, r, : r + 1] = memory.P[r, : r + 1]
            record.dx[slot] = memory.dx
    for r in range(memory.P.shape[0]):
        for c in range(r):
            memory.P[c, r] = memory.P[r, c]
    return -1


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def smooth_backward(lam, step, record, m, out):  # type: ignore[no-untyped-def]
    """Sweep λ (N,) back over a recorded segment and turn its filtered states `out` into smoothed ones."""
    T, n = out.shape[0], out.shape[1]
    d = np.empty(len(lam))
    for k in range(T - 1, -1, -1):
        P, dx = record.P[k], record.dx[k]
        d[:] = 0.0
        for r in range(len(lam)):
            # four sums, as one would wait for itself
            s0, s1, s2, s3, own, past = P[r, r] * lam[r], 0.0, 0.0, 0.0, lam[r], r - r % 4
            for c in range(0, past, 4):
                s0 += P[r, c] * lam[c]
                s1 += P[r, c + 1] * lam[c + 1]
                s2 += P[r, c + 2] * lam[c + 2]
                s3 += P[r, c + 3] * lam[c + 3]
            for c in range(past, r):
                s0 += P[r, c] * lam[c]
            for c in range(r):
                d[c] -= P[r, c] * own
            d[r] -= s0 + s1 + s2 + s3
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
        propagate_back(lam, record.F[k], m, step[k])
