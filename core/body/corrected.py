"""Sensor signals as input of the pose filters: corrected for bias at rest, in sensor axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sagittal.core.frames import GRAVITY, Bools, Floats, Segment
from sagittal.core.signals.calibrated import CalibratedRecording


def correct_signals(
    calibrated: CalibratedRecording, segments: Sequence[Segment], part: slice = slice(None)
) -> tuple[Floats, Floats, Bools]:
    """Specific force and angular rate (T, n, 3), valid (T, n) of the sensors of these segments, in order.

    For a part of the recording if one is given.

    The difference of |acc| at rest from G is subtracted as a bias along the segment axis that is vertical at
    rest, not as a scale factor; the gyroscope mean at rest is subtracted (docs/science/calibration.md,
    "Standing").
    """
    samples = len(calibrated.recording.t_s[part])
    valid = np.empty((samples, len(segments)), np.bool_)
    for i, segment in enumerate(segments):
        valid[:, i] = calibrated.recording.sensors[segment].valid[part]
    acc, gyr = (CorrectedSignals(calibrated, segments, name)[part] for name in SIGNALS)
    return acc, gyr, valid


SignalName = Literal["acc", "gyr"]
SIGNALS: tuple[SignalName, SignalName] = ("acc", "gyr")


@dataclass(frozen=True, eq=False)
class CorrectedSignals:
    """One signal as returned by `correct_signals`, computed for the requested part only."""

    calibrated: CalibratedRecording
    segments: Sequence[Segment]
    name: SignalName

    def __getitem__(self, part: slice, /) -> Floats:
        samples = len(self.calibrated.recording.t_s[part])
        out = np.empty((samples, len(self.segments), 3))
        for i, segment in enumerate(self.segments):
            mounted = self.calibrated.calibration.segments[segment]
            off = mounted.gyro_bias
            if self.name == "acc":
                off = (mounted.rest_norm - GRAVITY) * mounted.R_segment_sensor[1]
            held = self.calibrated.recording.sensors[segment].held(self.name)
            np.subtract(held[part], off, out=out[:, i], dtype=np.float64)
        return out
