"""Orientation of single sensors with self-calibration during movement.

One error-state Kalman filter for any number of sensors, live in blocks or smoothed over a whole recording:
docs/science/self-calibrating-filter.md.
"""

from sagittal.core.fusion.self_calibrating.filter import (
    SelfCalibratingFilter,
    SensorEstimates,
    SmoothedOrientations,
    smooth_orientations,
)
from sagittal.core.fusion.self_calibrating.params import SelfCalibratingParams

__all__ = [
    "SelfCalibratingFilter",
    "SelfCalibratingParams",
    "SensorEstimates",
    "SmoothedOrientations",
    "smooth_orientations",
]
