"""Result of calibration: sensor-to-segment alignment and gyroscope bias of each sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sagittal.core.errors import Notice
from sagittal.core.frames import Bools, Floats, Posture, Segment
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import (
    Window as Window,  # the calibration's windows are windows of rest and walking
)


@dataclass(frozen=True, eq=False)
class SegmentCalibration:
    """One sensor on its segment.

    Parameters
    ----------
    R_segment_sensor : (3, 3) maps sensor coordinates to ISB segment coordinates.
    gyro_bias : (3,) rad/s, sensor frame, mean over rest.
    rest_norm : |acc| at rest, m/s²; without rest the mean specific force of the walk. method : how the
        heading was determined: "walking_direction", "gyro_pca", "declared", "neighbour".
    score : 0 (guess) to 1 (certain); quality measure of the method, documented there.
    forward_sd : standard deviation of the anterior axis about the vertical, rad; None if not measured.
    start_q : (4,) sensor to W in the middle of `Calibration.zero`; None = neutral, as in standing.
    """

    R_segment_sensor: Floats
    gyro_bias: Floats
    rest_norm: float
    method: str
    score: float
    start_q: Floats | None = None
    forward_sd: float | None = None


@dataclass(frozen=True, eq=False)
class Calibration:
    """All sensors of a recording.

    Parameters
    ----------
    rest, walking : windows used; `walking` may consist of several straight parts. `rest` is empty without
        quiet standing.
    zero : window whose mean joint angles are subtracted: standing, or a straight part of the walk.
    turning : (n,) mask on the uniform axis, True while turning.
    straight_steps : approximate number in `walking`; None without a leg sensor or a walk. posture : the
        posture defined as neutral.
    """

    segments: Mapping[Segment, SegmentCalibration]
    rest: tuple[Window, ...]
    walking: tuple[Window, ...]
    zero: Window
    turning: Bools
    method: str
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)
    straight_steps: int | None = None
    posture: Posture = "standing"


@dataclass(frozen=True, eq=False)
class CalibratedRecording:
    """A uniform recording with the alignment of its sensors."""

    recording: UniformRecording
    calibration: Calibration
