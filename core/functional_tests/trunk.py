"""Motion of the trunk from one sensor on pelvis or chest in any orientation, without calibration.

The vertical comes from the filter of core/fusion/attitude.py, the gyroscope bias from the longest rest of the
sensor. docs/science/timed-tests.md, "Motion of the trunk".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.errors import EstimationError
from sagittal.core.frames import GRAVITY, Bools, Floats, Segment
from sagittal.core.fusion.attitude import AttitudeParams, estimate_orientation
from sagittal.core.message import Message
from sagittal.core.rotation import exp, find_vertical
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import find_rest_windows, index_window

TRUNK: Final[tuple[Segment, ...]] = ("pelvis", "chest")
"""Sensors that tell how the trunk moves, the better known first."""

UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class TrunkMotion:
    """A trunk sensor over a recording.

    Parameters
    ----------
    t_s : (n,). up : (n, 3) the vertical in sensor axes. acc : (n, 3) gravity-free, sensor axes, m/s². gyr :
        (n, 3) rad/s, bias-corrected. valid : (n,).
    rests : windows with the sensor still, s.
    """

    segment: Segment
    t_s: Floats
    rate_hz: float
    up: Floats
    acc: Floats
    gyr: Floats
    valid: Bools
    rests: tuple[tuple[float, float], ...]

    @property
    def upward(self) -> Floats:
        """Vertical acceleration (n,), m/s²."""
        return np.asarray(np.einsum("ni,ni->n", self.acc, self.up))

    @property
    def yaw_rate(self) -> Floats:
        """Yaw rate (n,), rad/s, left positive."""
        return np.asarray(np.einsum("ni,ni->n", self.gyr, self.up))


def find_trunk_sensor(recording: UniformRecording) -> Segment:
    """Segment of the trunk sensor to use; raises EstimationError `segments_missing`."""
    for segment in TRUNK:
        if segment in recording.sensors and recording.sensors[segment].valid.any():
            return segment
    raise EstimationError(
        "segments_missing",
        "This test requires a sensor on the pelvis or chest, and neither has data; attach or assign one.",
    )


def follow_trunk(recording: UniformRecording) -> TrunkMotion:
    """Track the trunk through a recording.

    Raises
    ------
    EstimationError `segments_missing` without a sensor on pelvis or chest; `no_rest` without any rest.
    """
    segment = find_trunk_sensor(recording)
    signals, rate = recording.sensors[segment], recording.rate_hz
    rests = find_rest_windows(recording, segments=(segment,))
    if not rests:
        raise EstimationError(
            "no_rest",
            Message(
                "The sensor on the {segment} is never still for one second. Ask the person to sit or stand "
                "still for a few seconds before the test starts.",
                segment=segment,
            ),
            sensor=segment,
        )
    longest = index_window(max(rests, key=lambda r: r[1] - r[0]), rate)
    gyr = signals.gyr - signals.gyr[longest].mean(axis=0)
    force = signals.acc[longest].mean(axis=0)
    norm = float(np.linalg.norm(force))
    q = estimate_orientation(
        _level(force / norm), longest.start, gyr, signals.acc, signals.valid, rate, norm, AttitudeParams()
    )
    up = find_vertical(q)
    acc = signals.acc * (GRAVITY / norm) - GRAVITY * up
    return TrunkMotion(segment, recording.t_s, rate, up, acc, gyr, signals.valid, rests)


def _level(up: Floats) -> Floats:
    """Shortest rotation (4,) that maps a unit vector (3,) to the vertical."""
    axis = np.cross(up, UP)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        axis, sine = np.array([1.0, 0.0, 0.0]), 1.0
    return exp(float(np.arctan2(np.linalg.norm(np.cross(up, UP)), up @ UP)) * axis / sine)
