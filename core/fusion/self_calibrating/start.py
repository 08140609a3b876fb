"""Initial orientation of a sensor, at rest or in motion: compiled, one sensor.

Equations: docs/science/self-calibrating-filter.md, "Start, and both ways".
"""

from __future__ import annotations

from math import sqrt

import numba
import numpy as np

from sagittal.core.fusion.self_calibrating.layout import (
    ACC_BIAS,
    ACC_DELAY,
    BIAS,
    C_SEEN,
    C_START,
    FIELD,
    FIRST_ACC,
    GRAVITY,
    IRON,
    MAG_DELAY,
    MATRIX,
    MOVED,
    NORM,
    NORTH,
    REGION,
    SHAKEN,
    SHIFT,
    SPEED,
    START_R,
    SUM_ACC,
    SUM_MAG,
    TILT,
    TURNED,
    WITH_MAG,
)
from sagittal.core.fusion.self_calibrating.motion import face_up
from sagittal.core.fusion.self_calibrating.params import (
    ACC_DELAY_SD_S,
    GRAVITY_MPS2,
    GRAVITY_SD,
    LEAST_FIELD,
    LEAST_FLAT,
    MAG_NOISE,
    MOVING_FORCE,
    MOVING_RATE,
    REGION_ACROSS_SD,
    SHAKEN_BIAS_SD,
    START_HEADING,
    START_MOVING,
    START_MOVING_S,
    START_S,
    START_SPEED,
    START_TILT,
)
from sagittal.core.rotation import compiled


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def is_known(v):  # type: ignore[no-untyped-def]
    """Whether all of v (3,) are finite and not all are zero."""
    total = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    return np.isfinite(total) and total > 0.0


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def take_start(x, P, p, dt, counters, gyr, acc, mag):  # type: ignore[no-untyped-def]
    """Process a sample of the initial phase: mean force and field in the axes of the first sample.

    Writes the current orientation to x; returns True at its end, with P and the nominal state set.
    """
    uses_mag = P.shape[0] == WITH_MAG
    R, q = np.empty((3, 3)), x[TURNED : TURNED + 4]
    if counters[C_SEEN] == 0:
        q[0] = 1.0
        x[FIRST_ACC : FIRST_ACC + 3] = acc
    else:
        compiled.turn(q, gyr[0] * dt, gyr[1] * dt, gyr[2] * dt)
    compiled.to_matrix(q, R)
    has_field = uses_mag and is_known(mag)
    for j in range(3):
        x[SUM_ACC + j] += R[j, 0] * acc[0] + R[j, 1] * acc[1] + R[j, 2] * acc[2]
        if has_field:
            x[SUM_MAG + j] += R[j, 0] * mag[0] + R[j, 1] * mag[1] + R[j, 2] * mag[2]
        if abs(gyr[j]) > MOVING_RATE or abs(acc[j] - x[FIRST_ACC + j]) > MOVING_FORCE:
            x[MOVED] = 1.0
    if has_field:
        counters[C_START] += 1
    counters[C_SEEN] += 1
    field, first = x[SUM_MAG : SUM_MAG + 3] / max(1, counters[C_START]), np.empty(4)
    face_up(x[SUM_ACC : SUM_ACC + 3], field, first)
    norm = sqrt(field[0] ** 2 + field[1] ** 2 + field[2] ** 2)
    x[NORM] = norm
    compiled.to_matrix(first, R)
    x[0], x[1], x[2], x[3] = compiled.multiply(first[0], first[1], first[2], first[3], q[0], q[1], q[2], q[3])
    moving = x[MOVED] > 0.0
    if counters[C_SEEN] < max(1, round((START_MOVING_S if moving else START_S) / dt)):
        return False
    if norm > 0.0:
        for j in range(3):
            x[NORTH + j] = (R[j, 0] * field[0] + R[j, 1] * field[1] + R[j, 2] * field[2]) / norm
        x[NORTH] = 0.0
    expect_start(x, P, p, moving)
    counters[C_START] = -1
    return True


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def expect_start(x, P, p, moving):  # type: ignore[no-untyped-def]
    """Set the nominal calibration and the initial covariance."""
    k = START_MOVING**2 if moving else 1.0
    P[:] = 0.0
    x[GRAVITY + SHIFT] = GRAVITY_MPS2
    for j in range(3):
        P[TILT + j, TILT + j] = START_TILT**2 * k
        P[BIAS + j, BIAS + j] = p.gyro_bias_sd**2
        P[SPEED + j, SPEED + j] = START_SPEED**2 * k
        P[ACC_BIAS + j, ACC_BIAS + j] = p.acc_bias_sd**2
        P[SHAKEN + j, SHAKEN + j] = SHAKEN_BIAS_SD**2
    P[TILT + 2, TILT + 2] = START_HEADING**2 * k
    for j in range(9):
        P[MATRIX + j, MATRIX + j] = p.gyro_matrix_sd**2
    P[GRAVITY, GRAVITY] = GRAVITY_SD**2
    P[ACC_DELAY, ACC_DELAY] = ACC_DELAY_SD_S**2
    if P.shape[0] == WITH_MAG:
        x[MAG_DELAY + SHIFT] = p.mag_delay_s
        P[MAG_DELAY, MAG_DELAY] = p.mag_delay_sd_s**2
        expect_field(x, P, p, moving)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def expect_field(x, P, p, moving):  # type: ignore[no-untyped-def]
    """Set the initial covariance of hard iron, local and regional field, and of the heading derived from the
    field.

    At rest the sum of local and regional field equals the reading, up to the noise of its mean, with the iron
    in its initial orientation.
    """
    north = x[NORTH + 1]
    noise = MAG_NOISE**2 / (START_MOVING_S if moving else START_S)
    for j in range(3):
        region = REGION_ACROSS_SD**2 if j == 0 else p.field_sd**2
        P[IRON + j, IRON + j] = p.hard_iron_sd**2
        P[REGION + j, REGION + j] = region + (0.0 if j == 0 else noise)
        P[FIELD + j, FIELD + j] = p.field_sd**2 if moving else region + LEAST_FIELD**2
        if not moving:
            P[FIELD + j, REGION + j] = P[REGION + j, FIELD + j] = -region
    if north > 0.0:
        heading = noise / max(north, LEAST_FLAT) ** 2
        P[TILT + 2, TILT + 2] = heading if not moving else P[TILT + 2, TILT + 2] + heading
        if not moving:
            R = np.empty((3, 3))
            compiled.to_matrix(x[0:4], R)
            for j in range(3):
                for i in range(3):
                    x[START_R + 3 * j + i] = R[j, i]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def start_from_first(x, P, p, dt, counters, gyr, acc, mag):  # type: ignore[no-untyped-def]
    """Determine the initial state of a whole recording, at its first sample."""
    none = np.zeros(3)
    for i in range(len(gyr)):
        if is_known(gyr[i]) or is_known(acc[i]):
            if not (np.isfinite(gyr[i].sum()) and np.isfinite(acc[i].sum())):
                continue
            if take_start(x, P, p, dt, counters, gyr[i], acc[i], mag[i] if len(mag) else none):
                break
    if counters[C_START] >= 0:
        # shorter than a start: nothing can be learnt, the orientation is turned along
        expect_start(x, P, p, x[MOVED] > 0.0)
    a, b, c, d = x[TURNED], x[TURNED + 1], x[TURNED + 2], x[TURNED + 3]
    x[0], x[1], x[2], x[3] = compiled.multiply(x[0], x[1], x[2], x[3], a, -b, -c, -d)
    counters[C_SEEN], counters[C_START] = 0, -1
