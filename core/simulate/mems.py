"""Errors of a MEMS device: noise, bias instability, scale errors, hard iron and range limits."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import radians
from typing import Final

import numpy as np

from sagittal.core.frames import GRAVITY, Bools, Floats
from sagittal.core.simulate.sensors import SimulatedSignals

ACC_RANGE: Final = 16.0 * GRAVITY
GYR_RANGE: Final = radians(2000.0)
"""Full scales of today's wearables, m/s² and rad/s."""


@dataclass(frozen=True)
class SensorNoise:
    """Errors of one sensor; densities are per √Hz, walks per √s (docs/science/simulation.md, "Devices").

    Parameters
    ----------
    gyr_bias, acc_bias, gyr_scale, acc_scale, hard_iron : standard deviations of constants drawn once per
        axis.
    mag_density, hard_iron : of a field with strength 1 (iron: our choice; sensors are calibrated at the
        factory, but mounting hardware may add more).
    """

    gyr_density: float = radians(0.01)
    gyr_bias: float = radians(0.3)
    gyr_walk: float = radians(0.003)
    gyr_scale: float = 0.002
    acc_density: float = 150e-6 * GRAVITY
    acc_bias: float = 0.02
    acc_walk: float = 2e-4
    acc_scale: float = 0.002
    mag_density: float = 2e-4
    hard_iron: float = 0.02

    def times(self, k: float) -> SensorNoise:
        """All errors multiplied by k."""
        return SensorNoise(**{f.name: k * getattr(self, f.name) for f in fields(self)})


MEMS: Final = SensorNoise()
"""A body-worn MEMS device of today."""


@dataclass(frozen=True, eq=False)
class DrawnErrors:
    """Constant errors of a sensor, all (3,): true = (measured − bias) / scale; hard iron is added."""

    gyr_bias: Floats
    gyr_scale: Floats
    acc_bias: Floats
    acc_scale: Floats
    hard_iron: Floats


def add_sensor_errors(
    ideal: SimulatedSignals,
    noise: SensorNoise,
    rate_hz: float,
    rng: np.random.Generator,
    of_iron: np.random.Generator,
) -> tuple[SimulatedSignals, DrawnErrors]:
    """Add scale errors, constant and varying biases, white noise and hard iron.

    Parameters
    ----------
    of_iron : a separate random stream, so that hard iron does not change the errors of accelerometer and
        gyroscope.
    """
    shape = ideal.acc.shape
    drawn = DrawnErrors(
        gyr_bias=rng.normal(0.0, noise.gyr_bias, 3),
        gyr_scale=1.0 + rng.normal(0.0, noise.gyr_scale, 3),
        acc_bias=rng.normal(0.0, noise.acc_bias, 3),
        acc_scale=1.0 + rng.normal(0.0, noise.acc_scale, 3),
        hard_iron=of_iron.normal(0.0, noise.hard_iron, 3),
    )
    root = np.sqrt(rate_hz)

    def wander(walk: float, density: float) -> Floats:
        return np.cumsum(rng.normal(0.0, walk / root, shape), axis=0) + rng.normal(0.0, density * root, shape)

    gyr = ideal.gyr * drawn.gyr_scale + drawn.gyr_bias + wander(noise.gyr_walk, noise.gyr_density)
    acc = ideal.acc * drawn.acc_scale + drawn.acc_bias + wander(noise.acc_walk, noise.acc_density)
    mag = ideal.mag + drawn.hard_iron + rng.normal(0.0, noise.mag_density * root, shape)
    return SimulatedSignals(acc, gyr, mag), drawn


def clip_signals(
    signals: SimulatedSignals, acc_range: float, gyr_range: float
) -> tuple[SimulatedSignals, Bools]:
    """The signals clipped to the ranges (m/s², rad/s per axis), and a mask (n,) of samples with any
    clipped axis.
    """
    too_much = (np.abs(signals.acc) > acc_range) | (np.abs(signals.gyr) > gyr_range)
    beyond: Bools = np.any(too_much, axis=1)
    if not beyond.any():
        return signals, beyond
    acc, gyr = np.clip(signals.acc, -acc_range, acc_range), np.clip(signals.gyr, -gyr_range, gyr_range)
    return SimulatedSignals(acc, gyr, signals.mag), beyond
