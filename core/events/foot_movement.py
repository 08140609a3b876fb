"""Movement of a foot in addition to its orientation: reveals swings with little pitch, and impacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from sagittal.core.frames import FOOT, Floats, Segment
from sagittal.core.rotation import find_lengths

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from sagittal.core.signals.calibrated import CalibratedRecording, SegmentCalibration
    from sagittal.core.signals.recording import SensorSignals


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
        """From signals (n, 3) of a sensor and its sensor-to-segment alignment."""
        speed = find_lengths(gyr - mounted.gyro_bias)
        return cls(speed, acc @ mounted.R_segment_sensor.T)

    def cut(self, part: slice) -> FootMovement:
        """A slice of the samples."""
        return FootMovement(self.speed[part], self.acc[part])


@dataclass(frozen=True, eq=False)
class FootMovements:
    """Motion of one foot over a recording, computed for the requested part only."""

    signals: SensorSignals
    mounted: SegmentCalibration

    def cut(self, part: slice) -> FootMovement:
        """A slice of the samples."""
        signals = self.signals
        return FootMovement.of_signals(signals.cut("acc", part), signals.cut("gyr", part), self.mounted)


def measure_foot_movements(calibrated: CalibratedRecording) -> Mapping[Segment, FootMovements]:
    """Motion of every calibrated foot."""
    mounted, sensors = calibrated.calibration.segments, calibrated.recording.sensors
    return {
        foot: FootMovements(sensors[foot], mounted[foot])
        for foot in FOOT.values()
        if foot in mounted and foot in sensors
    }
