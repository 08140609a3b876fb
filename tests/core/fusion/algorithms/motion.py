"""A sensor that turns about without leaving its place, with exact truth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from io import BytesIO

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.filter import RestMeans
from sagittal.core.rotation import angle_between, conjugate, exp, multiply, normalise, rotate

FIELD = np.array([0.0, np.cos(np.radians(63.0)), -np.sin(np.radians(63.0))]) * 48.0
"""µT, east north up."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class TurningSensors:
    """Signals (n, S, 3) and true orientations (n, S, 4) of S sensors."""

    gyr: Floats
    acc: Floats
    mag: Floats
    q: Floats
    rate_hz: float

    def rest(self) -> RestMeans:
        """Exact means of a rest in the first orientation."""
        return RestMeans(
            rotate(conjugate(self.q[0]), 9.81 * UP),
            np.zeros(self.gyr.shape[1:]),
            rotate(conjugate(self.q[0]), FIELD),
        )


@cache
def turning(
    seconds: float, *, rate_hz: float = 100.0, sensors: int = 2, speed: float = 1.0, noise: float = 1.0
) -> TurningSensors:
    """Sensors with sums of sines of angular rate (rad/s, times `speed`) and white noise times `noise`.

    Cached, since the sample-wise integration takes seconds: do not modify.
    """
    rng = np.random.default_rng(7)
    n = round(seconds * rate_hz)
    t = np.arange(n)[:, None, None] / rate_hz
    phase = rng.uniform(0.0, 2.0 * np.pi, (1, sensors, 3))
    rate = speed * (np.sin(1.3 * t + phase) + 0.7 * np.sin(2.9 * t + 2.0 * phase))
    q = np.empty((n, sensors, 4))
    now = normalise(rng.standard_normal((sensors, 4)))
    for k in range(n):
        now = normalise(multiply(now, exp(rate[k] / rate_hz)))
        q[k] = now
    shape = (n, sensors, 3)
    return TurningSensors(
        gyr=rate + noise * 0.005 * rng.standard_normal(shape),
        acc=rotate(conjugate(q), 9.81 * UP) + noise * 0.03 * rng.standard_normal(shape),
        mag=rotate(conjugate(q), FIELD) + noise * 0.2 * rng.standard_normal(shape),
        q=q,
        rate_hz=rate_hz,
    )


def error_deg(q: Floats, truth: Floats) -> Floats:
    """Angle in degrees between orientations (..., 4)."""
    return np.asarray(np.degrees(angle_between(q, truth)))


def tilt_deg(q: Floats, truth: Floats) -> Floats:
    """Angle in degrees between the verticals of orientations (..., 4)."""
    one, second = (rotate(conjugate(x), UP) for x in (q, truth))
    return np.asarray(np.degrees(np.arccos(np.clip((one * second).sum(-1), -1.0, 1.0))))


def trial_bytes(seconds: float = 6.0, rest_s: float = 2.0, **changes: Floats) -> bytes:
    """A trial as BROAD has them: a rest, then turning, at 100 Hz."""
    take = turning(seconds, rate_hz=100.0, sensors=1, noise=0.0)
    n, first = len(take.q), round(rest_s * 100.0)

    def with_rest(x: Floats, held: Floats) -> Floats:
        return np.concatenate((np.tile(held, (first, 1)), x[:, 0]))

    arrays = {
        "imu_gyr": with_rest(take.gyr, np.zeros(3)) + np.array([0.01, 0.0, 0.0]),
        "imu_acc": with_rest(take.acc, take.acc[0, 0]),
        "imu_mag": with_rest(take.mag, take.mag[0, 0]),
        "opt_quat": with_rest(take.q, take.q[0, 0]),
        "movement": np.arange(n + first) >= first,
        "sampling_rate": np.array(100.0),
    }
    file = BytesIO()
    np.savez(file, **(arrays | changes))
    return file.getvalue()
