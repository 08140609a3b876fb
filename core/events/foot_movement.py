"""How a foot moved, beside its orientation: what tells a swing that hardly pitches it, and a knock."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.frames import FOOT, Floats, Segment

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from core.calibration.result import CalibratedRecording, SegmentCalibration


class FootMovement(NamedTuple):
    """Motion of one foot.

    Parameters
    ----------
    speed : (n,) norm of the angular rate, rad/s, without bias. acc : (n, 3) specific force, foot axes, m/s².
    """

    speed: Floats
    acc: Floats

    @classmethod
    def of_signals(cls, acc: Floats, gyr: Floats, mounted: SegmentCalibration) -> FootMovement:
        """From signals (n, 3) of a sensor and how it sits."""
        speed = np.sqrt(((gyr - mounted.gyro_bias) ** 2).sum(axis=1))
        return cls(speed, acc @ mounted.R_segment_sensor.T)


def measure_foot_movements(calibrated: CalibratedRecording) -> Mapping[Segment, FootMovement]:
    """Motion of every foot that is calibrated."""
    mounted, sensors = calibrated.calibration.segments, calibrated.recording.sensors
    return {
        foot: FootMovement.of_signals(sensors[foot].acc, sensors[foot].gyr, mounted[foot])
        for foot in FOOT.values()
        if foot in mounted and foot in sensors
    }
