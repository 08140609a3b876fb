"""A sensor that is turned and carried about its place, with known orientation and known faults."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.rotation import conjugate, exp, log, multiply, rotate

NORTH = np.array([0.0, 0.5, -0.8660254])
"""Field of the world, 60° down."""


@dataclass(frozen=True, eq=False)
class SensorFaults:
    """rate read = (1 + matrix) rate + bias + shaken_bias × acceleration² in g²; the field is read
    `mag_delay_s` late, with `hard_iron` on top.
    """

    gyro_bias: Floats = field(default_factory=lambda: np.radians([0.3, -0.2, 0.25]))
    gyro_matrix: Floats = field(default_factory=lambda: np.diag([0.002, -0.0015, 0.001]))
    shaken_bias: Floats = field(default_factory=lambda: np.zeros(3))
    acc_bias: Floats = field(default_factory=lambda: np.array([0.008, -0.006, 0.004]))
    hard_iron: Floats = field(default_factory=lambda: np.array([0.004, 0.002, -0.003]))
    mag_delay_s: float = 0.010
    gyro_noise: float = 3.5e-4
    acc_noise: float = 0.002
    mag_noise: float = 0.0063


@dataclass(frozen=True, eq=False)
class MovingSensor:
    """Signals (n, 3) and truth q (n, 4) sensor to world, of the end of each sample's interval."""

    rate_hz: float
    gyr: Floats
    acc: Floats
    mag: Floats
    q: Floats
    faults: SensorFaults


def move_sensor(
    seconds: float = 60.0,
    rate_hz: float = 100.0,
    seed: int = 0,
    *,
    rest_s: float = 3.0,
    last_rest_s: float = 0.0,
    field_sd: float = 0.0,
    region: Floats | None = None,
    last_field: Floats = NORTH,
    turning: float = 2.0,
    shaking_m: float = 0.05,
    faults: SensorFaults | None = None,
) -> MovingSensor:
    """Simulate sines of turning (rad/s) and of place (m) after a rest; motion fades in over two seconds.

    Rates are the mean over each interval, so that integrating them gives the truth. `last_rest_s`: rest at
    the end, into which motion fades, with `last_field`; until then the field is that of the start, while
    moving with `region` (3,) on top, and strays by `field_sd`, another one every 0.4 s.
    """
    faults = faults or SensorFaults()
    rng = np.random.default_rng(seed)
    n, fine = round(seconds * rate_hz), 8
    dt = 1.0 / rate_hz
    t = np.arange(n * fine + 1) * dt / fine
    fade = np.clip((t - rest_s) / 2.0, 0.0, 1.0) ** 2 if rest_s else np.ones(len(t))
    if last_rest_s:
        fade *= np.clip((seconds - last_rest_s - t) / 2.0, 0.0, 1.0) ** 2
    omega = np.zeros((len(t), 3))
    place = np.zeros((len(t), 3))
    for axis in range(3):
        for _ in range(4):
            f, phase = rng.uniform(0.2, 1.5), rng.uniform(0, 2 * np.pi)
            omega[:, axis] += 0.5 * turning * np.sin(2 * np.pi * f * t + phase)
            f, phase = rng.uniform(0.5, 2.0), rng.uniform(0, 2 * np.pi)
            place[:, axis] += shaking_m * np.sin(2 * np.pi * f * t + phase)
    omega, place = omega * fade[:, None], place * fade[:, None]
    steps = exp(0.5 * (omega[1:] + omega[:-1]) * dt / fine)
    q = np.empty((len(t), 4))
    q[0] = exp(rng.normal(0.0, 0.5, 3))
    for k in range(len(steps)):
        q[k + 1] = multiply(q[k], steps[k])
    speed = np.gradient(place, dt / fine, axis=0)
    end = np.arange(1, n + 1) * fine
    middle = end - fine // 2
    rate = log(multiply(conjugate(q[end - fine]), q[end])) / dt
    world = (speed[end] - speed[end - fine]) / dt + np.array([0.0, 0.0, GRAVITY])
    acc = rotate(conjugate(q[middle]), world)
    late = np.maximum(end - fine // 2 - round(faults.mag_delay_s / dt * fine), 0)
    north = np.tile(NORTH, (n, 1))
    if field_sd:
        stray, keep = np.zeros(3), np.exp(-dt / 0.4)
        for k in range(n):
            stray = keep * stray + field_sd * np.sqrt(1.0 - keep**2) * rng.normal(size=3)
            north[k] += np.sqrt(fade[late[k]]) * stray
    if region is not None:
        north += np.sqrt(fade[late])[:, None] * region
    north[t[late] > seconds - last_rest_s] = last_field
    mag = rotate(conjugate(q[late]), north) + faults.hard_iron
    shaken = np.sum((world - np.array([0.0, 0.0, GRAVITY])) ** 2, axis=1) / GRAVITY**2
    root = np.sqrt(rate_hz)
    return MovingSensor(
        rate_hz,
        rate @ (np.eye(3) + faults.gyro_matrix).T
        + faults.gyro_bias
        + shaken[:, None] * faults.shaken_bias
        + rng.normal(0, faults.gyro_noise * root, (n, 3)),
        acc + faults.acc_bias + rng.normal(0, faults.acc_noise * root, (n, 3)),
        40.0 * (mag + rng.normal(0, faults.mag_noise * root, (n, 3))),
        q[end],
        faults,
    )


def find_errors(sensor: MovingSensor, q: Floats) -> Floats:
    """Rotation vectors (n, 3) of the world that turn estimates q (n, 4) to the truth, rad."""
    return log(multiply(sensor.q, conjugate(q)))
