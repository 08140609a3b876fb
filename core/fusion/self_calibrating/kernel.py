"""The filter's loops, one sensor: samples, the update at the end of an interval, and the backward pass.

Equations: docs/science/self-calibrating-filter.md, with the same symbols.
"""

from __future__ import annotations

from math import exp, floor, sqrt

import numba
import numpy as np

from sagittal.core.fusion.self_calibrating.covariance import (
    place_of,
    predict_covariance,
    solve,
    take_scalar,
    write_transition,
)
from sagittal.core.fusion.self_calibrating.layout import (
    ACC_DELAY,
    BIAS,
    C_INTERVAL,
    C_MAG,
    C_REST,
    C_RUN,
    C_SEEN,
    C_START,
    FIELD,
    GRAVITY,
    IRON,
    J_SHAKING,
    J_SLOW_SQUARE,
    J_SPEED_SQUARE,
    JUMPING,
    MAG_DELAY,
    MOVED,
    NORM,
    NORTH,
    PAUSE,
    PLACE,
    PLACE_SUMS,
    REGION,
    RING,
    S_ACC,
    S_ACC_SQUARE,
    S_CROSS,
    S_GYR,
    S_LOST,
    S_MAG,
    S_MAG_CROSS,
    S_MAG_R,
    S_R,
    S_R_RATE,
    S_RATE_SQUARE,
    S_SHAKING,
    S_SLOW_SQUARE,
    S_SPEED_SQUARE,
    SHIFT,
    SPEED,
    START_R,
    TILT,
    WITH_MAG,
)
from sagittal.core.fusion.self_calibrating.motion import tilt
from sagittal.core.fusion.self_calibrating.params import (
    ACC_NOISE,
    ACC_SHOCK_NOISE,
    FIELD_RATE,
    INTERVAL_S,
    JUMP_FIELD,
    JUMP_IRON,
    JUMP_PAUSE_S,
    JUMP_S,
    JUMP_SQUARE,
    LEAST_SPEED,
    LOST_PUSH,
    LOST_TURN,
    MAG_NOISE,
    MAG_RATE_NOISE,
    PLACE_ALIKE,
    PLACE_S,
    PLACE_SD,
    REST_NOISE,
    VELOCITY_TIME_S,
)
from sagittal.core.fusion.self_calibrating.start import is_known, take_start
from sagittal.core.rotation import compiled


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def count_interval(dt):  # type: ignore[no-untyped-def]
    """Samples between corrections."""
    return max(1, round(INTERVAL_S / dt))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def add_sample(x, sums, counters, ring, gyr, acc, mag, features, still, dt, work):  # type: ignore[no-untyped-def]
    """Integrate orientation and velocity over a sample and add to the interval's sums; mag (0,) without."""
    middle, R = work[0, :4], work[1:4, :3]
    shaking = features[J_SHAKING]
    ox = gyr[0] - x[4] - x[24] * shaking
    oy = gyr[1] - x[5] - x[25] * shaking
    oz = gyr[2] - x[6] - x[26] * shaking
    wx = ox - x[14] * ox - x[15] * oy - x[16] * oz
    wy = oy - x[17] * ox - x[18] * oy - x[19] * oz
    wz = oz - x[20] * ox - x[21] * oy - x[22] * oz
    for j in range(4):
        middle[j] = x[j]
    # the acceleration belongs to the middle of the sample's turn
    compiled.turn(middle, 0.5 * wx * dt, 0.5 * wy * dt, 0.5 * wz * dt)
    compiled.turn(x[0:4], wx * dt, wy * dt, wz * dt)
    compiled.to_matrix(middle, R)
    fx, fy, fz = acc[0] - x[10], acc[1] - x[11], acc[2] - x[12]
    Wx = R[0, 0] * wx + R[0, 1] * wy + R[0, 2] * wz
    Wy = R[1, 0] * wx + R[1, 1] * wy + R[1, 2] * wz
    Wz = R[2, 0] * wx + R[2, 1] * wy + R[2, 2] * wz
    ax = R[0, 0] * fx + R[0, 1] * fy + R[0, 2] * fz
    ay = R[1, 0] * fx + R[1, 1] * fy + R[1, 2] * fz
    az = R[2, 0] * fx + R[2, 1] * fy + R[2, 2] * fz
    cx, cy, cz = Wy * az - Wz * ay, Wz * ax - Wx * az, Wx * ay - Wy * ax
    delay = x[ACC_DELAY + SHIFT]
    ax, ay, az = ax - delay * cx, ay - delay * cy, az - delay * cz
    for r in range(3):
        for j in range(3):
            t = R[r, j] * dt
            sums[S_R + 3 * r + j] += t
            k = S_R_RATE + 9 * r + 3 * j
            sums[k] += t * ox
            sums[k + 1] += t * oy
            sums[k + 2] += t * oz
    sums[S_ACC] += ax * dt
    sums[S_ACC + 1] += ay * dt
    sums[S_ACC + 2] += az * dt
    sums[S_CROSS] += cx * dt
    sums[S_CROSS + 1] += cy * dt
    sums[S_CROSS + 2] += cz * dt
    az -= x[GRAVITY + SHIFT]
    x[7] += ax * dt
    x[8] += ay * dt
    x[9] += az * dt
    sums[S_RATE_SQUARE] += wx * wx + wy * wy + wz * wz
    sums[S_ACC_SQUARE] += ax * ax + ay * ay + az * az
    sums[S_SPEED_SQUARE] += features[J_SPEED_SQUARE]
    sums[S_SLOW_SQUARE] += features[J_SLOW_SQUARE]
    sums[S_SHAKING] += shaking
    for j in range(3):
        sums[S_GYR + j] += gyr[j]
    if still:
        counters[C_REST] += 1
    if len(mag):
        _add_field(x, sums, counters, ring, mag, dt, middle, (wx, wy, wz), (Wx, Wy, Wz), work)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _add_field(x, sums, counters, ring, mag, dt, middle, w, W, work):  # type: ignore[no-untyped-def]
    """Add the field, levelled by the orientation at the time of its measurement."""
    slot = counters[C_SEEN] % RING
    for j in range(4):
        ring[slot, j] = middle[j]
    for j in range(3):
        ring[slot, 4 + j] = w[j]
    if x[NORM] <= 0.0 or not is_known(mag):
        return
    delay = min(max(x[MAG_DELAY + SHIFT], -0.02), (RING - 2) * dt)
    back = min(max(floor(delay / dt + 0.5), 0), max(counters[C_RUN], 0))
    remaining_s = delay - back * dt
    slot = (counters[C_SEEN] - back) % RING
    q, R = work[4, :4], work[5:8, :3]
    for j in range(4):
        q[j] = ring[slot, j]
    compiled.turn(q, -remaining_s * ring[slot, 4], -remaining_s * ring[slot, 5], -remaining_s * ring[slot, 6])
    compiled.to_matrix(q, R)
    n = x[NORM]
    mx, my, mz = mag[0] / n, mag[1] / n, mag[2] / n
    ux = R[0, 0] * mx + R[0, 1] * my + R[0, 2] * mz
    uy = R[1, 0] * mx + R[1, 1] * my + R[1, 2] * mz
    uz = R[2, 0] * mx + R[2, 1] * my + R[2, 2] * mz
    sums[S_MAG] += ux
    sums[S_MAG + 1] += uy
    sums[S_MAG + 2] += uz
    sums[S_MAG_CROSS] += W[1] * uz - W[2] * uy
    sums[S_MAG_CROSS + 1] += W[2] * ux - W[0] * uz
    sums[S_MAG_CROSS + 2] += W[0] * uy - W[1] * ux
    for r in range(3):
        for j in range(3):
            sums[S_MAG_R + 3 * r + j] += R[r, j]
    counters[C_MAG] += 1


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def correct(x, P, sums, counters, dt, p, F, d, decay, previous_P, predicted_P, work):  # type: ignore[no-untyped-def]
    """End an interval: propagate P, update with velocity, field and rest, inject the errors into x; reset the
    sums.

    Writes F (6, m), d (m,) the estimated errors, decay (1,), and P before and after the propagation if arrays
    are given.
    """
    m = P.shape[0]
    n = counters[C_INTERVAL]
    duration = n * dt
    if P[TILT + 2, TILT + 2] > 1.0:  # heading is lost, without a field for long: keep its numbers small
        for j in range(m):
            P[TILT + 2, j] *= 0.1
        for j in range(m):
            P[j, TILT + 2] *= 0.1
    write_transition(sums, n, duration, F)
    rate_square, acc_square = sums[S_RATE_SQUARE] / n, sums[S_ACC_SQUARE] / n
    speed_square, slow_square = sums[S_SPEED_SQUARE] / n, sums[S_SLOW_SQUARE] / n
    way = 0.0 if counters[C_REST] == n else sqrt(3.0 * speed_square) * duration
    decay[0] = exp(-way / p.field_length_m - FIELD_RATE * duration)
    if len(previous_P):
        previous_P[:] = P
    predict_covariance(P, F, decay[0], work)
    turned = (p.gyro_noise**2 + p.gyro_rate_noise**2 * rate_square) * duration + LOST_TURN * sums[S_LOST]
    pushed = (ACC_NOISE**2 + ACC_SHOCK_NOISE**2 * acc_square) * duration + LOST_PUSH * sums[S_LOST]
    for j in range(3):
        P[TILT + j, TILT + j] += turned
        P[BIAS + j, BIAS + j] += p.gyro_bias_walk**2 * duration
        P[SPEED + j, SPEED + j] += pushed
    off, field_variance = np.zeros(3), 0.0
    if m == WITH_MAG:
        field_variance = _expect_field(x, P, sums, counters, dt, duration, p, rate_square, decay[0], off)
    if len(predicted_P):
        predicted_P[:] = P
    d[:] = 0.0
    indices, h, K = np.zeros(7, np.int64), np.zeros(7), work[0]
    h[0] = 1.0
    # what is left of the velocity is as large as the motion, less where that swings fast, and soon new
    bounding = p.velocity_gain**2 * min(speed_square, sqrt(speed_square * slow_square)) + LEAST_SPEED**2
    spread = 2.0 * VELOCITY_TIME_S * bounding / duration
    for j in range(3):
        indices[0] = SPEED + j
        take_scalar(P, d, K, indices, h, 1, -x[SPEED + SHIFT + j], spread)
    if m == WITH_MAG and counters[C_MAG] > 0 and x[JUMPING] == 0.0:
        k = 1.0 / counters[C_MAG]
        for j in range(3):
            for i in range(3):
                indices[i] = IRON + i
                h[i] = _turned_since_start(x, sums, counters, j, i)
            indices[3], h[3] = FIELD + j, 1.0
            indices[4], h[4] = REGION + j, 1.0
            indices[5], h[5] = MAG_DELAY, sums[S_MAG_CROSS + j] * k
            indices[6], h[6] = TILT + 2, x[NORTH + 1]
            # of the tilt a field says nothing that gravity does not say better: heading alone is taken
            take_scalar(P, d, K, indices, h, 7 if j == 0 else 6, off[j], field_variance)
    if counters[C_REST] < n:
        x[PLACE_SUMS] = 0.0
    elif m == WITH_MAG and _is_back(x, P, sums, counters, duration):
        indices[0], h[0] = TILT + 2, x[NORTH + 1]
        take_scalar(P, d, K, indices, h, 1, x[PLACE], PLACE_SD**2)
    if counters[C_REST] == n:
        h[0] = 1.0
        for j in range(3):
            indices[0] = BIAS + j
            take_scalar(
                P, d, K, indices, h, 1, sums[S_GYR + j] / n - x[BIAS + SHIFT + j], REST_NOISE**2 / duration
            )
    for i in range(m):
        for j in range(i):
            P[j, i] = P[i, j]
    tilt(x[0:4], d[0], d[1], d[2])
    for j in range(BIAS, m):
        x[j + SHIFT] += d[j]
    sums[:] = 0.0
    counters[C_INTERVAL], counters[C_REST], counters[C_MAG] = 0, 0, 0


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _is_back(x, P, sums, counters, duration):  # type: ignore[no-untyped-def]
    """Whether the sensor, at rest for `PLACE_S`, is where it started at rest; writes its level field to x.

    Evaluated once per rest, including the initial one.
    """
    if x[PLACE_SUMS] < 0.0 or counters[C_MAG] == 0 or x[MOVED] > 0.0:
        return False
    if x[PLACE_SUMS] == 0.0:
        x[PLACE : PLACE + 3] = 0.0
    for j in range(3):
        x[PLACE + j] += sums[S_MAG + j] / counters[C_MAG]
    x[PLACE_SUMS] += 1.0
    if x[PLACE_SUMS] * duration < PLACE_S:
        return False
    for j in range(3):
        x[PLACE + j] /= x[PLACE_SUMS]
    x[PLACE_SUMS] = -1.0
    flat = sqrt(x[PLACE] ** 2 + x[PLACE + 1] ** 2)
    alike = abs(flat - x[NORTH + 1]) < PLACE_ALIKE and abs(x[PLACE + 2] - x[NORTH + 2]) < PLACE_ALIKE
    unsure = x[NORTH + 1] ** 2 * P[TILT + 2, TILT + 2]
    return alike and x[PLACE] ** 2 < 9.0 * (unsure + PLACE_SD**2)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _turned_since_start(x, sums, counters, j, i):  # type: ignore[no-untyped-def]
    """Element j, i of the interval's mean orientation minus that at the start: the field added by hard
    iron.
    """
    return sums[S_MAG_R + 3 * j + i] / counters[C_MAG] - x[START_R + 3 * j + i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _expect_field(x, P, sums, counters, dt, duration, p, rate_square, decay, off):  # type: ignore[no-untyped-def]
    """Propagate the field's deviation, detect magnets that appear or disappear; write off (3,) and its
    noise.
    """
    for j in range(3):
        P[FIELD + j, FIELD + j] += p.field_sd**2 * (1.0 - decay * decay)
        x[FIELD + SHIFT + j] *= decay
    if counters[C_MAG] == 0:
        return 0.0
    k = 1.0 / counters[C_MAG]
    variance = (MAG_NOISE**2 + MAG_RATE_NOISE**2 * rate_square) / (counters[C_MAG] * dt)
    worst, h = 0.0, np.empty(3)
    for j in range(3):
        e = sums[S_MAG + j] * k - x[NORTH + j] - x[FIELD + SHIFT + j] - x[REGION + SHIFT + j]
        v = variance + (sums[S_MAG_CROSS + j] * k) ** 2 * P[MAG_DELAY, MAG_DELAY]
        v += P[FIELD + j, FIELD + j] + P[REGION + j, REGION + j] + 2.0 * P[FIELD + j, REGION + j]
        if j == 0:
            v += x[NORTH + 1] ** 2 * P[TILT + 2, TILT + 2]
        for i in range(3):
            h[i] = _turned_since_start(x, sums, counters, j, i)
            e -= h[i] * x[IRON + SHIFT + i]
            v += 2.0 * h[i] * (P[IRON + i, FIELD + j] + P[IRON + i, REGION + j])
            for c in range(i + 1):
                v += (1.0 if c == i else 2.0) * h[i] * h[c] * P[IRON + i, IRON + c]
        off[j] = e
        worst = max(worst, e * e / v)
    x[JUMPING] = x[JUMPING] + duration if worst > JUMP_SQUARE else 0.0
    x[PAUSE] -= duration
    if x[JUMPING] > JUMP_S and x[PAUSE] <= 0.0:
        for j in range(3):
            P[IRON + j, IRON + j] += JUMP_IRON**2
            P[FIELD + j, FIELD + j] += JUMP_FIELD**2
        _part_from_start(x, P, p)
        x[JUMPING], x[PAUSE] = 0.0, JUMP_PAUSE_S
    return variance


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _part_from_start(x, P, p):  # type: ignore[no-untyped-def]
    """Attribute the iron in the initial reading to the region: a new magnet was not part of it."""
    for j in range(3):
        for i in range(3):
            x[REGION + SHIFT + j] -= x[START_R + 3 * j + i] * x[IRON + SHIFT + i]
            P[REGION + j, REGION + j] += x[START_R + 3 * j + i] ** 2 * p.hard_iron_sd**2
    x[START_R : START_R + 9] = 0.0


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_forward(  # type: ignore[no-untyped-def]
    x,
    P,
    sums,
    counters,
    ring,
    gyr,
    acc,
    mag,
    features,
    still,
    dt,
    p,
    out,
    raw,
    F,
    d,
    decay,
    previous_P,
    predicted_P,
):
    """Advance one sensor over a block and write q (n, 4).

    raw (n, 4), F, d, decay, before, after, an entry for each interval: the record for the backward pass, all
    empty if not required.
    """
    m = P.shape[0]
    uses_mag, recorded, k = m == WITH_MAG, len(F) > 0, 0
    nothing, none = np.empty((0, 0)), np.zeros(3)
    F1, d1, decay1, wide = np.empty((6, m)), np.empty(m), np.empty(1), np.empty((6, m))
    work = np.empty((8, 4))
    interval = count_interval(dt)
    for i in range(len(gyr)):
        is_finite = True
        for j in range(3):
            is_finite = is_finite and np.isfinite(gyr[i, j]) and np.isfinite(acc[i, j])
        if counters[C_START] >= 0:
            if is_finite:
                take_start(x, P, p, dt, counters, gyr[i], acc[i], mag[i] if uses_mag else none)
            for j in range(4):
                out[i, j] = x[j]
            continue
        if is_finite:
            add_sample(
                x,
                sums,
                counters,
                ring,
                gyr[i],
                acc[i],
                mag[i] if uses_mag else none[:0],
                features[i],
                still[i],
                dt,
                work,
            )
            counters[C_SEEN] += 1
            counters[C_RUN] += 1
        else:
            sums[S_LOST] += dt
            counters[C_RUN] = 0
        counters[C_INTERVAL] += 1
        for j in range(4):
            out[i, j] = x[j]
        if recorded:
            for j in range(4):
                raw[i, j] = x[j]
        if counters[C_INTERVAL] == interval:
            if recorded:
                correct(
                    x, P, sums, counters, dt, p, F[k], d[k], decay[k], previous_P[k], predicted_P[k], wide
                )
                k += 1
            else:
                correct(x, P, sums, counters, dt, p, F1, d1, decay1, nothing, nothing, wide)
            for j in range(4):
                out[i, j] = x[j]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def smooth_backward(interval, raw, F, d, decay, previous_P, predicted_P, out):  # type: ignore[no-untyped-def]
    """Backward smoothing over the intervals (Rauch, Tung and Striebel); writes out (n, 4).

    Samples after the last whole interval are unchanged.
    """
    m = previous_P.shape[1]
    error, end, y, z, L = np.zeros(m), np.empty(m), np.empty(m), np.empty(m), np.empty((m, m))
    for k in range(len(previous_P) - 1, -1, -1):
        for j in range(m):
            end[j] = d[k, j] + error[j]  # at the end of the interval, before its correction
            y[j] = end[j]
        solve(predicted_P[k], y, L)
        if m == WITH_MAG:
            for j in range(FIELD, FIELD + 3):
                y[j] *= decay[k, 0]
        for c in range(m):
            t = y[c]
            for r in range(6):
                t += F[k, r, c] * y[place_of(r)]
            z[c] = t
        for j in range(m):
            t = 0.0
            for c in range(m):
                t += previous_P[k, j, c] * z[c]
            error[j] = t  # at its start
        for i in range(interval):
            share, row = (i + 1) / interval, k * interval + i
            for j in range(4):
                out[row, j] = raw[row, j]
            tilt(
                out[row],
                error[0] + (end[0] - error[0]) * share,
                error[1] + (end[1] - error[1]) * share,
                error[2] + (end[2] - error[2]) * share,
            )
