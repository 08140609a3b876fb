"""Knee hinge axis in thigh and shank axes, from their angular rates alone.

Apart from rotation about the common hinge both segments rotate together: |ω₁ × j₁| = |ω₂ × j₂| at every
sample, with j₁ and j₂ the hinge axis in the axes of each (Seel et al. 2014, doi:10.3390/s140406891).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np

from sagittal.core.frames import SHANK, SIDES, THIGH, Floats, Side
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import index_window

MOST_SAMPLES: Final = 2000
"""More are thinned: a step has some fifty of its own."""

STEEPEST: Final = radians(45.0)
"""A hinge found further out of the horizontal plane of its segment is no knee, but skin (our choice)."""

KNEE_SEEN: Final = 6.0
"""Seconds of straight walking below which skin decides where a knee's axis comes out
(docs/science/calibration.md, "Score")."""

INDEPENDENT: Final = 13.0
"""The whole walk counts as so many independent samples, those of one stride below 6 Hz: skin moves with every
stride alike."""

SKIN_SD: Final = radians(1.5)
"""What skin turns the axis by that no misfit shows, on simulated people."""

ROUNDS: Final = 20
SETTLED: Final = 1e-4
RIDGE: Final = 1e-3
LONGEST_STEP: Final = 0.5


@dataclass(frozen=True)
class KneeAxes:
    """Direction of the hinge axis.

    Parameters
    ----------
    thigh, shank : its rotation about the long axis of the segment relative to the medio-lateral axis, rad.
    steepest : the larger of the two angles to the segment's transverse plane, rad.
    thigh_sd, shank_sd : standard deviations of the turns, rad.
    """

    thigh: float
    shank: float
    steepest: float
    thigh_sd: float
    shank_sd: float

    @property
    def apart(self) -> float:
        """Disagreement of the thigh and shank forward axes about the hinge, rad."""
        return self.thigh - self.shank


def measure_knees(calibrated: CalibratedRecording) -> dict[Side, KneeAxes]:
    """Hinge axis of every knee with both sensors available in enough straight walking."""
    recording, mounted = calibrated.recording, calibrated.calibration.segments
    straight = np.zeros(len(recording.t_s), np.bool_)
    for window in calibrated.calibration.walking:
        straight[index_window(window, recording.rate_hz)] = True
    axes: dict[Side, KneeAxes] = {}
    for side in SIDES:
        pair = (THIGH[side], SHANK[side])
        if not set(pair) <= set(mounted):
            continue
        mask = np.logical_and.reduce([straight, *(recording.sensors[s].valid for s in pair)])
        if np.count_nonzero(mask) < KNEE_SEEN * recording.rate_hz:
            continue
        thigh, shank = (
            (recording.sensors[s].gyr[mask] - mounted[s].gyro_bias) @ mounted[s].R_segment_sensor.T
            for s in pair
        )
        axes[side] = find_knee_axes(thigh, shank)
    return axes


def find_knee_axes(thigh: Floats, shank: Floats) -> KneeAxes:
    """Fit the hinge axis by Gauss-Newton, starting from the medio-lateral axes.

    Parameters
    ----------
    thigh, shank : (n, 3) bias-corrected rates in segment axes, rad/s, at the same samples.
    """
    thin = max(1, len(thigh) // MOST_SAMPLES)
    first, second = thigh[::thin], shank[::thin]
    x = np.zeros(4)
    weight = RIDGE * np.sqrt(len(first)) * np.eye(4)
    for _ in range(ROUNDS):
        e1, J1 = _measure_across(first, x[:2])
        e2, J2 = _measure_across(second, x[2:])
        J = np.concatenate((np.concatenate((J1, -J2), axis=1), weight))
        step = np.linalg.lstsq(J, np.concatenate((e2 - e1, np.zeros(4))), rcond=None)[0]
        size = float(np.linalg.norm(step))
        x += step * min(1.0, LONGEST_STEP / max(size, 1e-12))
        if size < SETTLED:
            break
    independent = min(len(first), INDEPENDENT)
    # the ridge counts as much beside the measurements as it did in the fit
    information = J.T @ J * (independent / len(first) / max(float(np.mean((e2 - e1) ** 2)), 1e-12))
    sd = np.sqrt(np.diag(np.linalg.inv(information)) + SKIN_SD**2)
    return KneeAxes(float(x[0]), float(x[2]), float(max(abs(x[1]), abs(x[3]))), float(sd[0]), float(sd[2]))


def _measure_across(rate: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """|ω × j| (n,) and its derivative (n, 2) by the two angles of j."""
    (ca, sa), (ce, se) = ((np.cos(v), np.sin(v)) for v in turn)
    j = np.array([ce * sa, se, ce * ca])
    dj = np.array([[ce * ca, -se * sa], [0.0, ce], [-ce * sa, -se * ca]])
    perpendicular = np.cross(rate, j)
    size = np.linalg.norm(perpendicular, axis=1)
    slope = np.cross(perpendicular, rate) / np.maximum(size, 1e-9)[:, None]
    return size, slope @ dj
