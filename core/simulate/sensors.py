"""The IMUs: how they sit on the segments, what they would measure, and what a MEMS device makes of it.

Units and gravity sign as in core/frames.py: at rest the accelerometer reads +g along the up axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import pi, radians
from typing import Final, Literal

import numpy as np

from core.frames import GRAVITY, Floats, Segment
from core.rotation import conjugate, exp, log, multiply, rotate
from core.simulate.human import Motion
from core.simulate.soft_tissue import SoftTissue, skin_motion
from core.simulate.spline import kinematics, sign_continuous
from core.simulate.walker import Walker

Sampling = Literal["instant", "increment"]
"""instant: values at the sample; increment: mean over the interval before it, as strapdown devices send."""

PLACES: Final[Mapping[Segment, tuple[float, float, float]]] = {
    "pelvis": (-0.10, 0.04, 0.0),
    "thigh_r": (0.06, -0.20, 0.03),
    "shank_r": (0.05, -0.15, 0.01),
    "foot_r": (0.09, -0.03, 0.0),
    "thigh_l": (0.06, -0.20, -0.03),
    "shank_l": (0.05, -0.15, -0.01),
    "foot_l": (0.09, -0.03, 0.0),
}
"""Where sensors sit on the reference person, m, in segment axes: sacrum, front of thigh and shank, instep."""

PLACE_SPREAD_M: Final = 0.02
"""Sensors are put within ± this of their place along each axis."""

FIELD_DIP: Final = radians(65.0)
"""Inclination of the Earth's field below the horizon in central Europe; its strength is the unit (Xsens)."""


@dataclass(frozen=True, eq=False)
class Mount:
    """One sensor on its segment.

    Parameters
    ----------
    position_m : (3,) of the sensor in segment axes. q_segment_sensor : (4,) sensor to segment.
    """

    position_m: Floats
    q_segment_sensor: Floats


@dataclass(frozen=True)
class SensorNoise:
    """Errors of one sensor; densities are per √Hz, walks per √s (spec/estimators.md §2.2 "MEMS").

    Parameters
    ----------
    gyr_bias, acc_bias, gyr_scale, acc_scale : standard deviations of constants drawn once per axis.
    mag_density : of a field with strength 1; the field itself is homogeneous.
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

    def times(self, k: float) -> SensorNoise:
        """All errors k times as large."""
        return SensorNoise(**{f.name: k * getattr(self, f.name) for f in fields(self)})


MEMS: Final = SensorNoise()
"""A body-worn MEMS device of today."""


@dataclass(frozen=True, eq=False)
class DrawnErrors:
    """Constant errors a sensor was given, all (3,): true = (measured − bias) / scale."""

    gyr_bias: Floats
    gyr_scale: Floats
    acc_bias: Floats
    acc_scale: Floats


@dataclass(frozen=True, eq=False)
class Signals:
    """What one sensor measures; (n, 3) each, sensor axes, at the recording's rate.

    acc m/s², gyr rad/s, mag in units of the Earth's field.
    """

    acc: Floats
    gyr: Floats
    mag: Floats


def draw_mounts(walker: Walker, spread_rad: float, rng: np.random.Generator) -> dict[Segment, Mount]:
    """Put the seven sensors on, each turned about a random axis by up to `spread_rad` (0: as the segment)."""
    mounts: dict[Segment, Mount] = {}
    for segment, place in PLACES.items():
        position = walker.scale * (np.array(place) + rng.uniform(-PLACE_SPREAD_M, PLACE_SPREAD_M, 3))
        axis = rng.standard_normal(3)
        turn = rng.uniform(0.0, min(spread_rad, pi)) * axis / np.linalg.norm(axis)
        mounts[segment] = Mount(position, exp(turn))
    return mounts


def ideal_signals(
    motion: Motion,
    segment: Segment,
    mount: Mount,
    tissue: SoftTissue | None,
    every: int,
    sampling: Sampling,
    north_rad: float,
) -> Signals:
    """Signals of an errorless sensor at every `every`-th sample of the motion.

    Parameters
    ----------
    tissue : between sensor and bone, None = stiff. north_rad : heading of magnetic north in the world.
    """
    place, turn = mount.position_m, mount.q_segment_sensor
    skin = None if tissue is None else skin_motion(motion, segment, tissue)
    if skin is not None:
        place, turn = place + skin[1], multiply(skin[0], turn)
    p = motion.p[segment] + rotate(motion.q[segment], place)
    q = sign_continuous(multiply(motion.q[segment], turn))
    velocity, acceleration, rate = kinematics(motion.t_s, p, q)
    up = np.array([0.0, 0.0, GRAVITY])
    north = np.array(
        [np.cos(FIELD_DIP) * np.cos(north_rad), np.cos(FIELD_DIP) * np.sin(north_rad), -np.sin(FIELD_DIP)]
    )
    q = q[::every]
    gyr, force = rate[::every], acceleration[::every] + up
    acc = rotate(conjugate(q), force)
    if sampling == "increment":
        # sample k covers the interval before it; the first has none and stays as it is
        step = every / motion.rate_hz
        start = conjugate(q[:-1])
        gyr = np.concatenate((gyr[:1], log(multiply(start, q[1:])) / step))
        mean_force = np.diff(velocity[::every], axis=0) / step + up
        acc = np.concatenate((acc[:1], rotate(start, mean_force)))
    return Signals(acc, gyr, rotate(conjugate(q), north))


def with_errors(
    ideal: Signals, noise: SensorNoise, rate_hz: float, rng: np.random.Generator
) -> tuple[Signals, DrawnErrors]:
    """Add scale errors, constant and wandering biases and white noise."""
    shape = ideal.acc.shape
    drawn = DrawnErrors(
        gyr_bias=rng.normal(0.0, noise.gyr_bias, 3),
        gyr_scale=1.0 + rng.normal(0.0, noise.gyr_scale, 3),
        acc_bias=rng.normal(0.0, noise.acc_bias, 3),
        acc_scale=1.0 + rng.normal(0.0, noise.acc_scale, 3),
    )
    root = np.sqrt(rate_hz)

    def wander(walk: float, density: float) -> Floats:
        return np.cumsum(rng.normal(0.0, walk / root, shape), axis=0) + rng.normal(0.0, density * root, shape)

    gyr = ideal.gyr * drawn.gyr_scale + drawn.gyr_bias + wander(noise.gyr_walk, noise.gyr_density)
    acc = ideal.acc * drawn.acc_scale + drawn.acc_bias + wander(noise.acc_walk, noise.acc_density)
    mag = ideal.mag + rng.normal(0.0, noise.mag_density * root, shape)
    return Signals(acc, gyr, mag), drawn
