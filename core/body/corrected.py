"""Sensor signals as the pose filters take them: without the bias of rest, sensor axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.calibration.result import CalibratedRecording
from core.frames import GRAVITY, Bools, Floats, Segment


def correct_signals(
    calibrated: CalibratedRecording, segments: Sequence[Segment]
) -> tuple[Floats, Floats, Bools]:
    """Specific force and angular rate (T, n, 3), valid (T, n) of the sensors of these segments, in order.

    What |acc| at rest differs from G is taken off as a bias along the segment's axis that is vertical at
    rest, not as a scale; the gyroscope's mean at rest is taken off (docs/science/calibration.md, "Standing").
    """
    acc, gyr, valid = [], [], []
    for segment in segments:
        signals, mounted = calibrated.recording.sensors[segment], calibrated.calibration.segments[segment]
        excess = (mounted.rest_norm - GRAVITY) * mounted.R_segment_sensor[1]
        acc.append(signals.acc - excess)
        gyr.append(signals.gyr - mounted.gyro_bias)
        valid.append(signals.valid)
    return np.stack(acc, axis=1), np.stack(gyr, axis=1), np.stack(valid, axis=1)
