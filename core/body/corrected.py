"""Sensor signals as the pose filters take them: without the bias of rest, sensor axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.calibration.result import CalibratedRecording
from core.frames import GRAVITY, Bools, Floats, Segment


def correct_signals(
    calibrated: CalibratedRecording, segments: Sequence[Segment], part: slice = slice(None)
) -> tuple[Floats, Floats, Bools]:
    """Specific force and angular rate (T, n, 3), valid (T, n) of the sensors of these segments, in order.

    Of a part of the take where one is given.

    What |acc| at rest differs from G is taken off as a bias along the segment's axis that is vertical at
    rest, not as a scale; the gyroscope's mean at rest is taken off (docs/science/calibration.md, "Standing").
    """
    samples = len(calibrated.recording.t_s[part])
    acc, gyr = np.empty((samples, len(segments), 3)), np.empty((samples, len(segments), 3))
    valid = np.empty((samples, len(segments)), np.bool_)
    for i, segment in enumerate(segments):
        signals, mounted = calibrated.recording.sensors[segment], calibrated.calibration.segments[segment]
        excess = (mounted.rest_norm - GRAVITY) * mounted.R_segment_sensor[1]
        np.subtract(signals.held("acc")[part], excess, out=acc[:, i])
        np.subtract(signals.held("gyr")[part], mounted.gyro_bias, out=gyr[:, i])
        valid[:, i] = signals.valid[part]
    return acc, gyr, valid
