"""Simulated IMUs: their position and alignment on the segments, and their ideal signals.

Units and gravity sign as in core/frames.py: at rest the accelerometer reads +g along the up axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import GRAVITY, Floats, Segment
from sagittal.core.rotation import about, conjugate, exp, log, multiply, rotate
from sagittal.core.simulate.gait.human import BodyPath
from sagittal.core.simulate.gait.impacts import Impact, shake_sensor
from sagittal.core.simulate.gait.soft_tissue import SoftTissue, skin_motion
from sagittal.core.simulate.magnetics import Dipole, field_at
from sagittal.core.simulate.spline import differentiate_pose, resample_pose, sign_continuous

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


@dataclass(frozen=True, eq=False)
class Mount:
    """One sensor on its segment.

    Parameters
    ----------
    position_m : (3,) of the sensor in segment axes. q_segment_sensor : (4,) sensor to segment.
    """

    position_m: Floats
    q_segment_sensor: Floats


@dataclass(frozen=True, eq=False)
class SensorPath:
    """Position and orientation of a sensor at times t_s (n,): p (n, 3) m, q (n, 4) sensor to world."""

    t_s: Floats
    p: Floats
    q: Floats

    def delay(self, by_s: float) -> SensorPath:
        """The same path delayed by `by_s`; stationary before its start and after its end."""
        if by_s == 0.0:
            return self
        times = np.clip(self.t_s - by_s, self.t_s[0], self.t_s[-1])
        p, q = resample_pose(self.t_s, self.p, self.q, times)
        return SensorPath(self.t_s, p, q)


@dataclass(frozen=True, eq=False)
class SimulatedSignals:
    """Signals of one sensor; (n, 3) each, sensor axes, at the recording's rate.

    acc m/s², gyr rad/s, mag in units of the Earth's field.
    """

    acc: Floats
    gyr: Floats
    mag: Floats


def draw_mounts(
    places: Mapping[Segment, tuple[float, float, float]],
    scale: float,
    spread_rad: float,
    rng: np.random.Generator,
) -> dict[Segment, Mount]:
    """Place sensors at `places` · scale, each rotated about a random axis by up to `spread_rad`."""
    mounts: dict[Segment, Mount] = {}
    for segment, place in places.items():
        position = scale * (np.array(place) + rng.uniform(-PLACE_SPREAD_M, PLACE_SPREAD_M, 3))
        axis = rng.standard_normal(3)
        turn = rng.uniform(0.0, min(spread_rad, pi)) * axis / np.linalg.norm(axis)
        mounts[segment] = Mount(position, exp(turn))
    return mounts


def place_sensor(
    body: BodyPath,
    segment: Segment,
    mount: Mount,
    tissue: SoftTissue | None,
    impacts: tuple[Impact, ...] = (),
) -> SensorPath:
    """Path of a sensor on a moving body.

    Parameters
    ----------
    tissue : between sensor and bone, None = rigid. impacts : contacts that make it vibrate.
    """
    place, turn, bone = mount.position_m, mount.q_segment_sensor, body.q[segment]
    skin = None if tissue is None else skin_motion(body.q, segment, tissue)
    if skin is not None:
        place, turn = place + skin[1], multiply(skin[0], turn)
    p = body.p[segment] + rotate(bone, place)
    if impacts:
        shift, angle = shake_sensor(body.t_s, segment, impacts)
        p, bone = p + shift, multiply(bone, about(2, angle))
    return SensorPath(body.t_s, p, sign_continuous(multiply(bone, turn)))


def ideal_signals(
    path: SensorPath, every: int, sampling: Sampling, north_rad: float = 0.0, dipoles: tuple[Dipole, ...] = ()
) -> SimulatedSignals:
    """Ideal signals of a sensor at every `every`-th sample of its path.

    Parameters
    ----------
    north_rad : heading of magnetic north in the world. dipoles : ferromagnetic objects that distort the
        field.
    """
    velocity, acceleration, rate = differentiate_pose(path.t_s, path.p, path.q)
    up = np.array([0.0, 0.0, GRAVITY])
    q = path.q[::every]
    gyr, force = rate[::every], acceleration[::every] + up
    acc = rotate(conjugate(q), force)
    if sampling == "increment":
        # sample k covers the interval before it; the first has none and stays as it is
        step = every * (path.t_s[1] - path.t_s[0])
        start = conjugate(q[:-1])
        gyr = np.concatenate((gyr[:1], log(multiply(start, q[1:])) / step))
        mean_force = np.diff(velocity[::every], axis=0) / step + up
        acc = np.concatenate((acc[:1], rotate(start, mean_force)))
    mag = rotate(conjugate(q), field_at(path.p[::every], north_rad, dipoles))
    return SimulatedSignals(acc, gyr, mag)
