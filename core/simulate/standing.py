"""Quiet standing with sway as an inverted pendulum, with sensors on pelvis and chest
(docs/science/simulation.md, "Sway").

The body is rigid from the ankles up and moves on an ellipse at one frequency, so that all sway parameters
have a closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Final

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import GRAVITY, Segment
from sagittal.core.rotation import about, multiply, rotate
from sagittal.core.simulate.gait.stance import Q_NEUTRAL
from sagittal.core.simulate.recorder import Draws, Recorded, oversampling, record
from sagittal.core.simulate.sensors import Mount, SensorPath, draw_mounts
from sagittal.core.simulate.setup import RecordingSetup
from sagittal.core.simulate.spline import sign_continuous
from sagittal.core.simulate.walker import Walker

HEIGHTS_M: Final[dict[Segment, float]] = {"pelvis": 0.95, "chest": 1.30}
"""Sensors above the ankles of the reference person."""


@dataclass(frozen=True)
class Sway:
    """Antero-posterior and lateral lean amplitudes, rad, and cycles per second."""

    forward_rad: float = 0.008
    side_rad: float = 0.004
    frequency_hz: float = 0.5
    duration_s: float = 40.0

    def __post_init__(self) -> None:
        if not (0.0 < self.frequency_hz <= 3.0 and self.duration_s > 0.0):
            raise ParameterError(
                "sway_range",
                f"{self.frequency_hz:g} Hz for {self.duration_s:g} s; expected up to 3 Hz, above 0 s.",
            )


@dataclass(frozen=True)
class SwayTruth:
    """Closed-form acceleration of a sensor at a height above the ankles during sway.

    Parameters
    ----------
    forward, side : amplitudes of its horizontal acceleration, m/s².
    """

    sway: Sway
    forward: float
    side: float

    @property
    def rms(self) -> float:
        """Root mean square, m/s²."""
        return sqrt(0.5 * (self.forward**2 + self.side**2))

    @property
    def area(self) -> float:
        """Ellipse of 95 %, m²/s⁴: 2π·3 times the product of both standard deviations."""
        return 3.0 * pi * self.forward * self.side

    @property
    def jerk(self) -> float:
        """Half of the integrated squared derivative of the acceleration over the whole time, m²/s⁵."""
        return 0.5 * (2.0 * pi * self.sway.frequency_hz * self.rms) ** 2 * self.sway.duration_s


@dataclass(frozen=True, eq=False)
class SwaySimulation(Recorded):
    """A recording of quiet standing with its ground truth by segment."""

    truth: dict[Segment, SwayTruth]


def simulate_sway(
    sway: Sway | None = None, height_m: float = 1.75, seed: int = 0, setup: RecordingSetup | None = None
) -> SwaySimulation:
    """Simulate a person of a height in quiet standing with sway.

    Raises
    ------
    ParameterError : "sway_range", "height_implausible".
    """
    sway, setup, draws = sway or Sway(), setup or RecordingSetup(), Draws(seed)
    scale = Walker.of_height(height_m).scale
    rate = oversampling(setup.rate_hz) * setup.rate_hz
    t = np.arange(round(sway.duration_s * rate) + 1) / rate
    around = 2.0 * pi * sway.frequency_hz * t
    forward, side = sway.forward_rad * np.sin(around), sway.side_rad * np.cos(around)
    q = multiply(multiply(Q_NEUTRAL, about(2, -forward)), about(0, side))
    none = (0.0, 0.0, 0.0)
    mounts = draw_mounts(dict.fromkeys(HEIGHTS_M, none), scale, setup.mount_spread_rad, draws.mounts)
    paths, truth = {}, {}
    for segment, height_fraction in HEIGHTS_M.items():
        height = scale * height_fraction
        mount = Mount(np.zeros(3), mounts[segment].q_segment_sensor)
        way = rotate(q, np.array([0.0, height, 0.0]))
        paths[segment] = SensorPath(t, way, sign_continuous(multiply(q, mount.q_segment_sensor)))
        gain = GRAVITY + height * (2.0 * pi * sway.frequency_hz) ** 2
        truth[segment] = SwayTruth(sway, gain * sway.forward_rad, gain * sway.side_rad)
    recorded = record(paths, setup, draws, height_m, protocol="standing_eyes_open")
    return SwaySimulation(**vars(recorded), truth=truth)
