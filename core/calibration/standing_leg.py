"""Detection of the supporting leg with sensors on both legs: the lower ankle is on the floor.

Only inclinations relative to gravity are used, so neither heading nor a rotation of a sensor about the long
axis of its segment matters (docs/science/squat.md, "Two legs").
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sagittal.core.frames import SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import index_window

LIFTED_M: Final = 0.04
"""An ankle so far above the other one, against standing, is off the floor (our choice: inclinations from
smoothed accelerations leave 1 to 2 cm)."""

SMOOTH_S: Final = 0.4
"""Window of the mean that is taken twice over the direction of gravity (our choice)."""

USUAL_HEIGHT_M: Final = 1.70
THIGH_AND_SHANK: Final = 0.2455
"""Mean length of thigh and shank as a share of body height (Winter 2009, figure 4.1)."""
HIPS: Final = 0.1
"""Distance of the hip centres as a share of body height: about 17 cm."""


def find_standing_legs(calibrated: CalibratedRecording) -> dict[Side, Bools]:
    """Side → (n,) True where the foot of that leg is assumed to be on the floor.

    Parameters
    ----------
    calibrated : with a standing window in which both feet are on the floor.

    Returns
    -------
    Legs with sensors on shank and thigh; all True if only one has them, or the pelvis has none.
    """
    mounted = calibrated.calibration.segments
    legs = [side for side in SIDES if SHANK[side] in mounted and THIGH[side] in mounted]
    n = len(calibrated.recording.t_s)
    if len(legs) < 2 or "pelvis" not in mounted:
        return {side: np.ones(n, bool) for side in legs}
    height = calibrated.recording.subject.height_m or USUAL_HEIGHT_M
    # of the left ankle above the right one: legs reach down along y, the right hip lies along z
    legs_down = {
        side: sum(_measure_up(calibrated, s, 1) for s in (SHANK[side], THIGH[side])) for side in legs
    }
    height_difference = THIGH_AND_SHANK * height * (legs_down["right"] - legs_down["left"])
    height_difference = height_difference - HIPS * height * _measure_up(calibrated, "pelvis", 2)
    standing = index_window(calibrated.calibration.zero, calibrated.recording.rate_hz)
    height_difference = height_difference - height_difference[standing].mean()
    return {"left": height_difference <= LIFTED_M, "right": height_difference >= -LIFTED_M}


def _measure_up(calibrated: CalibratedRecording, segment: Segment, axis: int) -> Floats:
    """Vertical component (n,) of a segment axis from smoothed gravity; interpolated across data loss."""
    from scipy.ndimage import uniform_filter1d

    recording = calibrated.recording
    signals, R = recording.sensors[segment], calibrated.calibration.segments[segment].R_segment_sensor
    indices = np.flatnonzero(signals.valid)
    force = signals.acc[indices] @ R.T
    force = np.stack([np.interp(np.arange(len(signals.valid)), indices, x) for x in force.T], axis=1)
    width = max(1, round(SMOOTH_S * recording.rate_hz))
    for _ in range(2):
        force = uniform_filter1d(force, width, axis=0, mode="nearest")
    return np.asarray(force[:, axis] / np.linalg.norm(force, axis=1))
