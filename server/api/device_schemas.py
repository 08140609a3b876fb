"""What the API says of the clinic's sensors, in SI units; what is not defined is null."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class DeviceCheckAnswer:
    """What one take showed of a sensor, in its own axes, or why nothing.

    `rest_s`: the window, from the sensor's first sample. `bias_error`: what the wearer may have turned at.
    `up`: the vertical. `rthz`: per √Hz.
    """

    day: dt.date
    segment: str
    rate_hz: float
    rest_s: tuple[float, float] | None
    gyro_bias_rad_s: list[float] | None
    bias_error_rad_s: float | None
    up: list[float] | None
    rest_norm_mps2: float | None
    gravity_scale: float | None
    gyro_noise_rad_s_rthz: float | None
    acc_noise_mps2_rthz: float | None
    reason: str | None


@dataclass(frozen=True)
class DeviceAnswer:
    """A sensor: where it was worn last, what is said of it and why, its newest checks, oldest first."""

    device_id: str
    last_worn_on: dt.date
    last_segment: str
    takes: int
    state: Literal["steady", "changed", "unknown"]
    words: str
    reasons: list[str]
    checks: list[DeviceCheckAnswer]
