"""Speed of a sensor about its position, and rest detection: compiled, one sensor."""

from __future__ import annotations

from math import exp

import numba
import numpy as np

from sagittal.core.fusion.self_calibrating.layout import (
    C_MOTION,
    J_SHAKING,
    J_SLOW_SQUARE,
    J_SPEED_SQUARE,
    M_ACC,
    M_FORCE,
    M_GYR,
    M_Q,
    M_REST,
    M_SLOW_SPEED,
    M_SLOW_SQUARE,
    M_SPEED,
    M_SQUARE,
)
from sagittal.core.fusion.self_calibrating.params import (
    GRAVITY_MPS2,
    INTENSITY_TIME_S,
    MOTION_TIME_S,
    REST_AFTER_S,
    REST_FORCE,
    REST_MEAN_S,
    REST_RATE,
    SLOW_SHARE,
)
from sagittal.core.rotation import compiled


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def face_up(force, field, q):  # type: ignore[no-untyped-def]
    """Write q (4,) that aligns force (3,) with up and field (3,), unless it is zero, with north."""
    n = np.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    q[0], q[1], q[2], q[3] = 1.0, 0.0, 0.0, 0.0
    if n < 1e-9:
        return
    a, b, c = force[0] / n, force[1] / n, force[2] / n
    if c < -0.999999:
        q[0], q[1] = 0.0, 1.0
    else:
        k = 1.0 / np.sqrt(2.0 * (1.0 + c))
        q[0], q[1], q[2] = (1.0 + c) * k, b * k, -a * k
    if field[0] != 0.0 or field[1] != 0.0 or field[2] != 0.0:
        R = np.empty((3, 3))
        compiled.to_matrix(q, R)
        east = R[0, 0] * field[0] + R[0, 1] * field[1] + R[0, 2] * field[2]
        north = R[1, 0] * field[0] + R[1, 1] * field[1] + R[1, 2] * field[2]
        tilt(q, 0.0, 0.0, np.arctan2(east, north))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def tilt(q, a, b, c):  # type: ignore[no-untyped-def]
    """Rotate q (4,) in place by the rotation vector (a, b, c) in world axes, rad: q ← Exp((a, b, c)) ⊗ q."""
    square = a * a + b * b + c * c
    if square > 1e-16:
        angle = np.sqrt(square)
        k, w = np.sin(0.5 * angle) / angle, np.cos(0.5 * angle)
    else:
        k, w = 0.5, 1.0 - square / 8.0
    w, i, j, k = compiled.multiply(w, k * a, k * b, k * c, q[0], q[1], q[2], q[3])
    s = 1.0 / np.sqrt(w * w + i * i + j * j + k * k)
    q[0], q[1], q[2], q[3] = w * s, i * s, j * s, k * s


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def judge_motion(u, counters, gyr, acc, dt, features, still):  # type: ignore[no-untyped-def]
    """Advance the state u (22,) and write judged (n, 3), see the layout, and still (n,), True at rest.

    The speed is integrated from the acceleration without its slow part and then high-passed again: the result
    is motion about a fixed position. Non-finite samples have no effect and do not count as rest.
    """
    q, R = u[M_Q : M_Q + 4], np.empty((3, 3))
    k = 1.0 - exp(-dt / MOTION_TIME_S)
    slow = 1.0 - exp(-dt / INTENSITY_TIME_S)
    mean = 1.0 - exp(-dt / REST_MEAN_S)
    none = np.zeros(3)
    for i in range(len(gyr)):
        is_finite = True
        for j in range(3):
            is_finite = is_finite and np.isfinite(gyr[i, j]) and np.isfinite(acc[i, j])
        if not is_finite:
            u[M_REST] = 0.0
            features[i, J_SPEED_SQUARE], features[i, J_SLOW_SQUARE] = u[M_SQUARE], u[M_SLOW_SQUARE]
            features[i, J_SHAKING], still[i] = 0.0, False
            continue
        first = counters[C_MOTION] == 0
        counters[C_MOTION] += 1
        if first:
            face_up(acc[i], none, q)
        compiled.turn(q, gyr[i, 0] * dt, gyr[i, 1] * dt, gyr[i, 2] * dt)
        compiled.to_matrix(q, R)
        total, lasting, shaken, off_rate, off_force, largest = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(3):
            a = R[j, 0] * acc[i, 0] + R[j, 1] * acc[i, 1] + R[j, 2] * acc[i, 2]
            if first:
                u[M_ACC + j], u[M_GYR + j], u[M_FORCE + j] = a, gyr[i, j], acc[i, j]
            u[M_ACC + j] += k * (a - u[M_ACC + j])
            shaken += (a - u[M_ACC + j]) ** 2
            u[M_SPEED + j] = (1.0 - k) * u[M_SPEED + j] + (a - u[M_ACC + j]) * dt
            u[M_SLOW_SPEED + j] += k * (u[M_SPEED + j] - u[M_SLOW_SPEED + j])
            total += (u[M_SPEED + j] - u[M_SLOW_SPEED + j]) ** 2
            lasting += u[M_SLOW_SPEED + j] ** 2
            u[M_GYR + j] += mean * (gyr[i, j] - u[M_GYR + j])
            u[M_FORCE + j] += mean * (acc[i, j] - u[M_FORCE + j])
            off_rate += (gyr[i, j] - u[M_GYR + j]) ** 2
            off_force += (acc[i, j] - u[M_FORCE + j]) ** 2
            largest = max(largest, abs(u[M_GYR + j]))
        if first:
            u[M_SQUARE], u[M_SLOW_SQUARE] = total / 3.0, SLOW_SHARE * lasting / 3.0
        u[M_SQUARE] += slow * (total / 3.0 - u[M_SQUARE])
        u[M_SLOW_SQUARE] += slow * (SLOW_SHARE * lasting / 3.0 - u[M_SLOW_SQUARE])
        features[i, J_SPEED_SQUARE], features[i, J_SLOW_SQUARE] = u[M_SQUARE], u[M_SLOW_SQUARE]
        features[i, J_SHAKING] = shaken / GRAVITY_MPS2**2
        if off_rate > REST_RATE**2 or off_force > REST_FORCE**2 or largest > REST_RATE:
            u[M_REST] = 0.0
        else:
            u[M_REST] += dt
        still[i] = u[M_REST] > REST_AFTER_S


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def average_backwards(x, dt):  # type: ignore[no-untyped-def]
    """Average x (n,) in place from the end backward: combined with the forward mean it has no lag."""
    k = 1.0 - exp(-dt / INTENSITY_TIME_S)
    mean = x[-1]
    for i in range(len(x) - 1, -1, -1):
        mean += k * (x[i] - mean)
        x[i] = mean
