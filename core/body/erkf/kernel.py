"""The compiled loops of the ErKF: forward over a block of samples, and backward over it for the smoother.

A sample is one `advance`: predict, add noise, judge contacts, correct, inject. It is shared by live blocks,
whole recordings and the smoother's second pass, so all give bit-identical results. Data for the smoother are
written to a `SmootherRecord`; without one the same slot is overwritten every sample.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from sagittal.core.body.erkf.predict import move, propagate, reset_before
from sagittal.core.body.erkf.sweep import copy_row, move_smoothed, multiply_lower, sweep_back
from sagittal.core.body.erkf.updates import (
    POSITION,
    VELOCITY,
    complete_rows,
    heading_rows,
    joint_rows,
    second_order_variance,
    subtract_blocks,
    take_block,
    tilt_rows,
    turn_apart,
    velocity_rows,
)
from sagittal.core.frames import Bools, Floats
from sagittal.core.rotation.compiled import to_matrix, turn
from sagittal.core.signals.inner import UNCOUNTED, inner_njit

INVALID, CONTACT, STILL, PATCHED = 1, 2, 4, 8
"""Bits of a sample's flags."""

NONE_KEPT: Final[Floats] = np.empty((0, 0))
"""`kept` of a block of which no states are kept."""


class SmootherRecord(NamedTuple):
    """Record of the forward pass over one segment for the backward pass; K samples or 1.

    F (K, n, 5, 3, 3) · V (K, B, 3, as P) · E (K, B, 9) · H (K, B, 2, 3, 3) · place (K, B, 4) · blocks (K,) ·
    Q (K, N) diagonal added to the covariance before the blocks · dx (K, N) injected.
    """

    F: Floats
    V: Floats
    E: Floats
    H: Floats
    place: NDArray[np.int64]
    blocks: NDArray[np.int64]
    Q: Floats
    dx: Floats


class ErkfMemory(NamedTuple):
    """State carried from one sample to the next, advanced in place: `ErkfState` in the form used by the
    kernels.

    x (n, 16) · P (N, ≥ N), with the rest of each row 0, and seven additional rows of 0 (`memory_of`) · before
    (n, 6) · dx (N,) injected last · refused (n,).
    """

    x: Floats
    P: Floats
    before: Floats
    dx: Floats
    refused: NDArray[np.int64]


class ErkfSamples(NamedTuple):
    """A block: step (T,) s · acc, gyr (T, n, 3) · flags (T, n) · heading (T, n), or (0, n) for none ·
    rolling (T, n) rate of a foot in contact, rad/s, or (0, n) for none.
    """

    step: Floats
    acc: Floats
    gyr: Floats
    flags: NDArray[np.uint8]
    heading: Floats
    rolling: Floats


class ErkfOutput(NamedTuple):
    """Output of a block: nominal (T, n, 16), of one segment if states are retained · heading_sd (T, n) ·
    residual (T, J) · refused (T, n) · smoothed (T, n, 7) positions and orientations, or (0, n, 7).
    """

    nominal: Floats
    heading_sd: Floats
    residual: Floats
    refused: Bools
    smoothed: Floats

    def part(self, first: int, past: int) -> ErkfOutput:
        """The part for samples first … past − 1."""
        k = slice(first, past)
        return ErkfOutput(*(x[k] for x in self))  # type: ignore[arg-type] # the kinds of fields are known


class ErkfScratch(NamedTuple):
    """R (n, 3, 3) of the IMUs · U (blocks + 1, 3, 3), y (3,) of a block · vectors (10, 3) · taken (n,)
    accepted zero velocities, their σ (n,) · slack (J,) m of the joint centres.
    """

    R: Floats
    U: Floats
    y: Floats
    vectors: Floats
    taken: Bools
    zero_velocity: Floats
    slack: Floats


class Noise(NamedTuple):
    """Scalars of `ErkfParams`, negative if a correction is disabled."""

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
    roll_m: float


class Links(NamedTuple):
    """The tree: ends (J, 2), lever (J, 2, 3), axis (J, 2, 3), hinged (J,), forward (n, 3); sd (n, 2) σ_a,
    σ_ω."""

    ends: NDArray[np.int64]
    lever: Floats
    axis: Floats
    hinged: Bools
    forward: Floats
    sd: Floats


@inner_njit(**UNCOUNTED)
def is_within_gate(P, b, v, sd, gate):  # type: ignore[no-untyped-def]
    """vᵀ S⁻¹ v ≤ gate for the zero velocity of the IMU whose error state begins at b."""
    S = P[b + 3 : b + 6, b + 3 : b + 6]
    a, d, f = S[0, 0] + sd * sd, S[1, 1] + sd * sd, S[2, 2] + sd * sd
    p, q, r = S[1, 0], S[2, 0], S[2, 1]
    c0, c1, c2 = d * f - r * r, q * r - p * f, p * r - q * d
    det = a * c0 + p * c1 + q * c2
    s = v[0] * (c0 * v[0] + c1 * v[1] + c2 * v[2])
    s += v[1] * (c1 * v[0] + (a * f - q * q) * v[1] + (p * q - a * r) * v[2])
    s += v[2] * (c2 * v[0] + (p * q - a * r) * v[1] + (a * d - p * p) * v[2])
    return s <= gate * det


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def predict(memory, samples, k, noise, scratch, F):  # type: ignore[no-untyped-def]
    """Propagate all IMUs and the covariance to sample k; F (n, 5, 3, 3) is retained."""
    x, previous, dx, acc, gyr = memory.x, memory.before, memory.dx, samples.acc, samples.gyr
    R, vectors, m, dt = scratch.R, scratch.vectors, noise.m, samples.step[k]
    for i in range(F.shape[0]):
        move(x[i], previous[i], acc[k, i], gyr[k, i], dt, noise.first, R[i], F[i], vectors)
        reset_before(F[i], dx[i * m + 6 : i * m + 9])
    propagate(memory.P, F, m, dt)


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def add_noise(memory, samples, k, links, noise, Q):  # type: ignore[no-untyped-def]
    """Add the process noise of sample k, with its diagonal in Q (N,), and make it the previous sample."""
    P, previous, dt = memory.P, memory.before, samples.step[k]
    acc, gyr, flags, sd = samples.acc, samples.gyr, samples.flags, links.sd
    for i in range(previous.shape[0]):
        b = i * noise.m
        jump = 0.0
        for c in range(3):
            jump += (acc[k, i, c] - previous[i, c]) ** 2
        va = sd[i, 0] ** 2 + noise.impact**2 * jump
        vw = sd[i, 1] ** 2
        if flags[k, i] & INVALID:
            va, vw = noise.gap_acc**2, noise.gap_gyr**2
        elif flags[k, i] & PATCHED:
            va, vw = va + noise.patch_acc**2, vw + noise.patch_gyr**2
        for c in range(3):
            Q[b + c], Q[b + 3 + c], Q[b + 6 + c] = 0.0, va * dt * dt, vw * dt * dt
            if noise.m == 15:
                Q[b + 9 + c], Q[b + 12 + c] = noise.gyr_walk**2 * dt, noise.acc_walk**2 * dt
            previous[i, c] = acc[k, i, c]
            previous[i, 3 + c] = gyr[k, i, c]
    for r in range(P.shape[0]):
        P[r, r] += Q[r]


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def judge_contacts(memory, samples, k, noise, scratch, Q, refused):  # type: ignore[no-untyped-def]
    """For sample k write the uncertainty of each zero velocity, which are accepted and which the gate
    rejects.

    All are judged from the predicted state, before any block, so that the order does not matter.
    """
    P, x, count = memory.P, memory.x, memory.refused
    flags, accepted, sd = samples.flags[k], scratch.taken, scratch.zero_velocity
    for i in range(flags.shape[0]):
        accepted[i] = False
        refused[i] = False
        if not flags[i] & CONTACT or noise.zero_velocity < 0.0:
            count[i] = 0
            continue
        b, v = i * noise.m, x[i, 3:6]
        sd[i] = noise.zero_velocity
        if samples.rolling.shape[0] > 0:
            sd[i] = np.sqrt(sd[i] ** 2 + (noise.roll_m * samples.rolling[k, i]) ** 2)
        accepted[i] = noise.gate < 0.0 or is_within_gate(P, b, v, sd[i], noise.gate)
        refused[i] = not accepted[i]
        count[i] = 0 if accepted[i] else count[i] + 1
        if count[i] >= noise.reaccept:
            accepted[i] = True
            speed2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
            for c in range(3):
                P[b + c, b + c] += noise.reaccept_m**2
                P[b + 3 + c, b + 3 + c] += speed2
                Q[b + c] += noise.reaccept_m**2
                Q[b + 3 + c] += speed2


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def correct(memory, samples, k, links, noise, scratch, record, slot):  # type: ignore[no-untyped-def]
    """Accumulate all blocks of sample k in covariance and correction; False if one is not positive
    definite.
    """
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
    for i in range(x.shape[0]):
        complete_rows(P, i * m + 6)
        if links.ends.shape[0] > 0:
            complete_rows(P, i * m + POSITION)
        if scratch.taken[i]:
            complete_rows(P, i * m + VELOCITY)
    dx[:] = 0.0
    B = np.int64(0)  # of that type: for a literal all that takes it is compiled once more
    good = True
    for j in range(links.ends.shape[0]):
        a, c = links.ends[j, 0], links.ends[j, 1]
        for axis in range(2):
            if (noise.axis if axis else noise.centre) < 0.0 or (axis and not links.hinged[j]):
                continue
            sd = noise.axis if axis else scratch.slack[j]
            on = links.axis[j] if axis else links.lever[j]
            joint_rows(x, R, m, a, c, on[0], on[1], axis == 0, place[B], H[B], y)
            good &= take_block(P, dx, place[B], H[B], y, sd, V, B, E[B], U)
            B += 1
    for i in range(x.shape[0]):
        rests = samples.flags[k, i] & STILL
        if scratch.taken[i]:
            velocity_rows(x[i, 3:6], m, i, place[B], y)
            good &= take_block(P, dx, place[B], H[B], y, scratch.zero_velocity[i], V, B, E[B], U)
            B += 1
        if noise.tilt > 0.0 and (scratch.taken[i] or rests):
            tilt_rows(R[i], samples.acc[k, i], m, i, place[B], H[B], y)
            good &= take_block(P, dx, place[B], H[B], y, noise.tilt, V, B, E[B], U)
            B += 1
        # nested: heading_rows writes the block and may only run where a heading was measured
        if samples.heading.shape[0] > 0 and np.isfinite(samples.heading[k, i]):  # noqa: SIM102
            if heading_rows(R[i], links.forward[i], samples.heading[k, i], m, i, place[B], H[B], y):
                good &= take_block(P, dx, place[B], H[B], y, noise.heading, V, B, E[B], U)
                B += 1
    subtract_blocks(P, V, B)
    record.blocks[slot] = B
    return good


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def inject(memory, noise, scratch, nominal, heading_sd):  # type: ignore[no-untyped-def]
    """Inject the correction into the state; write the state (n, 16) and its heading standard deviations
    (n,).
    """
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
        copy_row(x[i], nominal[i])


@inner_njit(**UNCOUNTED)
def measure_joints(x, links, scratch, residual):  # type: ignore[no-untyped-def]
    """Write the distance (J,) of the two ends of each joint, m, for states x (n, 16) with rotations
    `scratch.R`.
    """
    y = scratch.y
    for j in range(residual.shape[0]):
        a, c = links.ends[j, 0], links.ends[j, 1]
        turn_apart(scratch.R, a, c, links.lever[j, 0], links.lever[j, 1], y)
        for r in range(3):
            y[r] += x[c, r] - x[a, r]
        residual[j] = np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2)


@numba.njit(cache=True, nogil=True, inline="always", **UNCOUNTED)  # type: ignore[misc, unused-ignore]
def advance(  # type: ignore[no-untyped-def]
    memory, samples, k, links, noise, scratch, record, slot, output, row
):
    """Filter sample k of a block, its state into a row of `output.nominal`: shared by files and streams;
    False if the covariance failed.
    """
    predict(memory, samples, k, noise, scratch, record.F[slot])
    add_noise(memory, samples, k, links, noise, record.Q[slot])
    judge_contacts(memory, samples, k, noise, scratch, record.Q[slot], output.refused[k])
    good = correct(memory, samples, k, links, noise, scratch, record, slot)
    inject(memory, noise, scratch, output.nominal[row], output.heading_sd[k])
    for r in range(memory.dx.shape[0]):
        good &= memory.P[r, r] > 0.0 and abs(memory.dx[r]) < 1e9
    if good:
        measure_joints(memory.x, links, scratch, output.residual[k])
    return good


@inner_njit(**UNCOUNTED)
def keep_state(memory, row):  # type: ignore[no-untyped-def]
    """Write the state into one row (`row_length`); of P only the lower triangle."""
    x, previous, P, offset = memory.x, memory.before, memory.P, 0
    for i in range(x.shape[0]):
        for c in range(16):
            row[offset + c] = x[i, c]
        for c in range(6):
            row[offset + 16 + c] = previous[i, c]
        row[offset + 22] = memory.refused[i]
        offset += 23
    for r in range(P.shape[0]):
        row[offset] = memory.dx[r]
        for c in range(r + 1):
            row[offset + 1 + c] = P[r, c]
        offset += r + 2


@inner_njit(**UNCOUNTED)
def restore_state(memory, row):  # type: ignore[no-untyped-def]
    """Inverse of `keep_state`; the upper triangle of P is left unchanged."""
    x, previous, P, offset = memory.x, memory.before, memory.P, 0
    for i in range(x.shape[0]):
        for c in range(16):
            x[i, c] = row[offset + c]
        for c in range(6):
            previous[i, c] = row[offset + 16 + c]
        memory.refused[i] = int(row[offset + 22])
        offset += 23
    for r in range(P.shape[0]):
        memory.dx[r] = row[offset]
        for c in range(r + 1):
            P[r, c] = row[offset + 1 + c]
        offset += r + 2


def row_length(n: int, N: int) -> int:
    """Length of the row written by `keep_state` for n IMUs and N errors."""
    return n * (16 + 6 + 1) + N + N * (N + 1) // 2


@numba.njit(cache=True, nogil=True, no_cfunc_wrapper=True)  # type: ignore[misc, unused-ignore]
def filter_segments(  # type: ignore[no-untyped-def]
    memory, samples, links, noise, record, output, states, segment, smoothing, lam,
):  # fmt: skip
    """Filter a block, `memory` in place; returns the sample at which the covariance failed, or −1.

    A single entry point for live blocks, whole recordings and the smoother, because `advance` takes a quarter
    of a minute to compile. All arguments are plain tuples: numba resolves the fields of a named tuple at
    every call, which costs 0.3 µs each.

    Parameters
    ----------
    states : (S, `row_length`) the state before each segment of this many samples, written, or with smoothing
        read. No rows: the block is one segment, and no state is retained.
    record : with room for one sample, or with smoothing for a segment.
    smoothing : filter each segment again from its row, the last first, and smooth it.
    lam : (N,) the adjoint λ after the block, zeros at the end of a recording; with smoothing that before it
        is written.
    """
    memory = ErkfMemory(*memory)
    samples = ErkfSamples(*samples)
    links = Links(*links)
    noise = Noise(*noise)
    record = SmootherRecord(*record)
    output = ErkfOutput(*output)
    n, J, N, T = memory.x.shape[0], links.ends.shape[0], memory.P.shape[0], samples.step.shape[0]
    scratch = ErkfScratch(
        np.empty((n, 3, 3)), np.empty((record.V.shape[1] + 1, 3, 3)), np.empty(3), np.empty((10, 3)),
        np.zeros(n, np.bool_), np.empty(n), np.empty(J),
    )  # fmt: skip
    length = segment if states.shape[0] > 0 else T
    adjoint = lam, np.empty(N), np.empty((length if smoothing else 0, N))
    return run_segments(
        memory, samples, links, noise, record, output, states, length, smoothing, scratch, adjoint
    )


@inner_njit(**UNCOUNTED)
def run_segments(  # type: ignore[no-untyped-def]
    memory, samples, links, noise, record, output, states, length, smoothing, scratch, adjoint,
):  # fmt: skip
    """`filter_segments` with work arrays provided by the caller.

    Like everything that runs per sample it is compiled without numba's reference counting (`_nrt`) and cannot
    allocate arrays: counting every array slice took a fifth of the time with 15 states and a third with 9.
    adjoint : λ (N,) as in `filter_segments`, d (N,), `swept` (K, N).
    """
    n, N, T = memory.x.shape[0], memory.P.shape[0], samples.step.shape[0]
    keeps = states.shape[0] > 0
    segments = states.shape[0] if keeps else 1
    lam, d, swept = adjoint
    for i in range(segments):
        s = segments - 1 - i if smoothing else i
        a, b = s * length, min((s + 1) * length, T)
        if smoothing:
            restore_state(memory, states[s])
        elif keeps:
            keep_state(memory, states[s])
        for k in range(a, b):
            slot = k - a if smoothing else 0
            if not advance(memory, samples, k, links, noise, scratch, record, slot, output, k - a):
                return k
            if smoothing:
                copy_row(memory.dx, record.dx[slot])
        if smoothing:
            step, nominal = samples.step[a:b], output.nominal[: b - a]
            sweep_back(lam, step, record, noise.m, swept)
            # the covariance is again that before the segment
            restore_state(memory, states[s])
            multiply_lower(memory.P, lam, d)
            move_smoothed(d, step, record, noise.m, swept, nominal)
            measure_smoothed(nominal, links, scratch, output.residual[a:b])
            for k in range(a, b):
                for j in range(n):
                    copy_row(nominal[k - a, j, 0:3], output.smoothed[k, j, 0:3])
                    copy_row(nominal[k - a, j, 6:10], output.smoothed[k, j, 3:7])
    for r in range(N):
        for c in range(r):
            memory.P[c, r] = memory.P[r, c]
    return -1


@inner_njit(**UNCOUNTED)
def measure_smoothed(states, links, scratch, residual):  # type: ignore[no-untyped-def]
    """Write the distances (K, J) of the two ends of each joint for states (K, n, 16), m."""
    for k in range(states.shape[0]):
        for i in range(states.shape[1]):
            to_matrix(states[k, i, 6:10], scratch.R[i])
        measure_joints(states[k], links, scratch, residual[k])
