"""Typical clinic mistakes: clock offsets, swapped labels, slipped sensors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sagittal.core.agreement.repair import take_lag_out
from sagittal.core.agreement.strides import find_main_axis
from sagittal.core.frames import Floats, Segment
from sagittal.core.rotation import exp, rotate
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.timeline import TimelineParams

SLIP_S = 0.3
"""A sensor that slips does so within this time."""


def delay_sensor(recording: UniformRecording, segment: Segment, late_s: float | Floats) -> UniformRecording:
    """One sensor late: its samples show what happened that much earlier; (n,) for a clock that drifts."""
    lag = np.broadcast_to(-np.asarray(late_s, float), recording.t_s.shape)
    moved = take_lag_out(recording.sensors[segment], recording.t_s, lag, recording.rate_hz, TimelineParams())
    # the ends that the shift leaves empty hold: a late sensor measures from its start to its end
    held = np.ones(len(recording.t_s), np.bool_)
    full = replace(moved, valid=np.where(moved.valid, moved.valid, held) & recording.sensors[segment].valid)
    return replace(recording, sensors={**recording.sensors, segment: full})


def slip_sensor(
    recording: UniformRecording, segment: Segment, by_rad: float, at_s: float, axis: Floats | None = None
) -> UniformRecording:
    """Rotate one sensor on its segment within `SLIP_S`, measured by its gyroscope.

    Parameters
    ----------
    axis : (3,) in sensor axes; None = its main rotation axis, medio-lateral.
    """
    x = recording.sensors[segment]
    about = find_main_axis(x.gyr) if axis is None else axis / np.linalg.norm(axis)
    share = np.clip((recording.t_s - at_s) / SLIP_S, 0.0, 1.0)
    angle = by_rad * (3.0 * share**2 - 2.0 * share**3)
    q = exp(angle[:, None] * about)
    rate = rotate(q, x.gyr) - np.gradient(angle, recording.t_s)[:, None] * about
    slipped = replace(x, acc=rotate(q, x.acc), gyr=rate, mag=None)
    return replace(recording, sensors={**recording.sensors, segment: slipped})


def find_middle(recording: UniformRecording) -> float:
    """Moment before and after which the right shank moves for equally long, s."""
    moved = np.cumsum(np.linalg.norm(recording.sensors["shank_r"].gyr, axis=1) > 1.0)
    return float(np.searchsorted(moved, moved[-1] / 2)) / recording.rate_hz
