"""Properties of a device: gyroscope bias, accelerometer scale and noise, measured at rest.

Definitions and rationale: docs/science/devices.md. Measured on the stream as recorded, before any resampling,
in the longest rest of this sensor; core/quality/device_course.py compares the checks.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal, Self

import numpy as np

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.signals.held_samples import is_complete
from sagittal.core.signals.recording import ImuStream, SensorSignals
from sagittal.core.signals.rest import (
    RestParams,
    Window,
    find_windows,
    index_window,
    is_drifting,
    measure_quietness,
    measure_turn,
)

NotChecked = Literal["no_gyroscope", "no_rest", "unit_suspect"]
"""Why a device could not be measured."""

NORM_RANGE: Final = (7.0, 13.0)
"""|f| at rest that can be gravity, m/s² (as core/calibration/standing.py asks)."""

PART_S: Final = 0.5
CALM: Final = 0.25
"""Noise is this quantile over parts of this length, s: the wearer's own unrest is no noise of the device (the
median of whole seconds varied up to 3.5 times on one device, this 2.7 times: docs/science/devices.md)."""

LONGEST_GAP: Final = 1.5
"""Steps of the nominal rate from which a pause between two samples is a gap (our choice)."""

_SERIAL: Final = re.compile(
    r"(?=.*[0-9].*[0-9])(?=.*[A-F])[0-9A-F]{8,16}|(?:[0-9A-F]{2}[:-]){5}[0-9A-F]{2}|device-[0-9A-F]{8}|[SX]I-[0-9]{6}",
    re.IGNORECASE,
)
"""Xsens and Movella, radio addresses, our own page for phones, APDM."""


@dataclass(frozen=True, eq=False)
class DeviceCheck:
    """One device in one recording; with a `reason` all are None except `device_id` and `rate_hz`.

    Parameters
    ----------
    rest_s : the window used, seconds from the stream's first sample.
    gyro_bias : (3,) rad/s in sensor axes. bias_error : rad/s, possible rotation of the wearer in that time.
    up : (3,) unit vector, vertical in sensor axes. rest_norm : |mean acc|, m/s².
    gyro_noise, acc_noise : densities in rad/s/√Hz and m/s²/√Hz, None below the resolution of the device.
    """

    device_id: str
    rate_hz: float
    rest_s: Window | None = None
    gyro_bias: Floats | None = None
    bias_error: float | None = None
    up: Floats | None = None
    rest_norm: float | None = None
    gyro_noise: float | None = None
    acc_noise: float | None = None
    reason: NotChecked | None = None

    @property
    def gravity_scale(self) -> float | None:
        """|acc| at rest relative to standard gravity: combined scale and bias of the axes in that
        orientation.
        """
        return None if self.rest_norm is None else self.rest_norm / GRAVITY

    def to_json(self) -> dict[str, object]:
        """Plain values, SI; undefined ones are None."""
        return {
            "device_id": self.device_id,
            "rate_hz": self.rate_hz,
            "rest_s": None if self.rest_s is None else list(self.rest_s),
            "gyro_bias": None if self.gyro_bias is None else self.gyro_bias.tolist(),
            "bias_error": self.bias_error,
            "up": None if self.up is None else self.up.tolist(),
            "rest_norm": self.rest_norm,
            "gyro_noise": self.gyro_noise,
            "acc_noise": self.acc_noise,
            "reason": self.reason,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Parse a check written by `to_json`."""
        values = {name: data[name] for name in cls.__dataclass_fields__}
        for name in ("gyro_bias", "up"):
            values[name] = None if values[name] is None else np.asarray(values[name], np.float64)
        values["rest_s"] = None if values["rest_s"] is None else tuple(values["rest_s"])
        return cls(**values)


def is_serial(device_id: str) -> bool:
    """Whether an id has the form of a serial number; only such devices are tracked over time.

    A column name ("pelvis") belongs to another device in the next recording. A file name, used as a
    substitute for a missing serial number, may identify the person: digits alone can be a date or a personal
    number.
    """
    return _SERIAL.fullmatch(device_id) is not None


def check_device(stream: ImuStream, params: RestParams | None = None) -> DeviceCheck:
    """Measure a device in the longest rest of its stream.

    Parameters
    ----------
    stream : as recorded; rows with a missing value and gaps are excluded. params : criteria for rest
        (core/signals/rest.py); slow rotations of the vertical are excluded.

    Notes
    -----
    The bias is the mean rate, which includes any rotation of the wearer: `bias_error` is the rotation of the
    vertical between the ends of the rest, at least `params.drift` (1°), over its duration. Noise is σ/√rate
    as in the simulator (data sheets give √2 times that), σ² half of the mean square of successive differences
    (von Neumann 1941, doi:10.1214/aoms/1177731677), which is insensitive to slow movement; the lower quartile
    over half seconds, which underestimates white noise by 4 %. A device with internal filtering gives lower
    values: compare it only with itself. |acc| at rest carries no information on a horizontal axis: compare
    rests in the same posture only.
    """
    params = params or RestParams()
    rate = stream.rate_hz
    if stream.held("gyr") is None:
        return DeviceCheck(stream.device_id, rate, reason="no_gyroscope")
    signals = _held(stream)
    rests = find_windows(measure_quietness(signals, rate, params).quiet, rate, params)
    still = [r for r in rests if not is_drifting(signals, r, rate, params)]
    if not still:
        return DeviceCheck(stream.device_id, rate, reason="no_rest")
    window = max(still, key=lambda r: r[1] - r[0])
    part = index_window(window, rate)
    acc, gyr = (signals.cut(name, part) for name in ("acc", "gyr"))
    mean = acc.mean(axis=0)
    norm = float(np.linalg.norm(mean))
    if not NORM_RANGE[0] <= norm <= NORM_RANGE[1]:
        return DeviceCheck(stream.device_id, rate, reason="unit_suspect")
    return DeviceCheck(
        stream.device_id,
        rate,
        rest_s=window,
        gyro_bias=gyr.mean(axis=0),
        bias_error=max(measure_turn(acc, rate)[0], params.drift) * rate / len(acc),
        up=mean / norm,
        rest_norm=norm,
        gyro_noise=_density(gyr, rate),
        acc_noise=_density(acc, rate),
    )


def _held(stream: ImuStream) -> SensorSignals:
    """The stream's samples; missing ones are held and invalid, as are those next to a gap in time."""
    complete = [is_complete(stream.held(name)) for name in ("acc", "gyr")]
    good = np.asarray(np.logical_and(*complete), np.bool_)
    acc, rates = stream.held("acc"), stream.held("gyr")
    if not good.all():
        last = np.maximum.accumulate(np.where(good, np.arange(len(good)), 0))
        acc, rates = (np.nan_to_num(x[last].astype(np.float64), copy=False) for x in (acc, rates))
    pause = np.diff(stream.t_s) > LONGEST_GAP / stream.rate_hz
    valid = good & ~np.concatenate(([False], pause)) & ~np.concatenate((pause, [False]))
    return SensorSignals(stream.device_id, acc, rates, None, valid, ~good)


def _density(x: Floats, rate_hz: float) -> float | None:
    """Noise density of x (n, 3), mean of the axes; None if no sample differs from the next."""
    width = max(2, round(PART_S * rate_hz))
    jumps = (np.diff(x, axis=0) ** 2).mean(axis=1)
    parts = [jumps[a : a + width].mean() for a in range(0, max(1, len(jumps) - width + 1), width)]
    calm = float(np.quantile(parts, CALM))
    return None if calm <= 0.0 else float(np.sqrt(0.5 * calm / rate_hz))
