"""Implausible units and signs, which would invalidate all results: detected by physics before any
computation.

Thresholds: docs/science/quality.md, "Units and signs" (rest norm 9.81 m/s² or 1 g ± 10 %, gyroscope at rest
below 0.2 rad/s, largest rate above 10 °/s) unless marked as our choice.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sagittal.core import rotation
from sagittal.core.errors import Notice, Severity
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.message import Message
from sagittal.core.quality.signals import Facts
from sagittal.core.signals.held_samples import is_complete
from sagittal.core.signals.rest import LARGEST_BIAS

TOLERANCE: Final = 0.10
FAR_OFF: Final = 0.25
"""Beyond this a scale error is no longer a scale error [our choice]; the worst real sensor was 6.6 % off."""
GYRO_REST: Final = 0.2
"""rad/s at rest; of a sensor whose acceleration shows that it walks, up to LARGEST_BIAS is an offset: degrees
read as radians would reach more than GYRO_RANGE there."""
GYRO_RANGE: Final = 40.0
"""rad/s; 2000 °/s, the widest range of wearable gyroscopes, is 34.9 [our choice]."""
GYRO_LEAST: Final = np.radians(10.0)
WALKING_STD: Final = 1.0
"""m/s² of |acc| over the take that only a moving body shows (pelvis 1.6, foot 4 on neura_walk)."""
NO_GRAVITY: Final = 0.5
"""m/s² at rest: only noise is left when gravity was removed [our choice]."""

_FIX_ACC = 'declare the unit in the manifest (sources[].acc_unit: "g" or "m/s2")'
_FIX_GYR = 'declare the unit in the manifest (sources[].gyr_unit: "deg/s" or "rad/s")'


def list_suspicions(device: str, f: Facts, acc: Floats, quat: Floats | None) -> list[Notice]:
    """All suspicions about one sensor, severe ones as errors; acc (n, 3) m/s², quat (n, 4)."""
    notices = [*_acceleration(device, f), *_rate(device, f)]
    if quat is not None:
        notices += _sign(device, acc, quat)
    return notices


def _say(code: str, message: str, device: str, severity: Severity = "error") -> Notice:
    return Notice(code, message, device, severity=severity)


def _acceleration(device: str, f: Facts) -> list[Notice]:
    n = f.still_norm
    if not f.still:
        return _moving_acceleration(device, f)
    off = abs(n / GRAVITY - 1.0)
    if off <= TOLERANCE:
        return []
    if abs(n - 1.0) <= TOLERANCE:
        return [
            _say(
                "unit_suspect",
                Message(
                    "Sensor {device}: acceleration at rest is {value:.2f}, expected 9.81 m/s² (±10 %); "
                    "it is in g but was read as m/s²: {FIX_ACC}.",
                    device=device,
                    value=n,
                    FIX_ACC=_FIX_ACC,
                ),
                device,
            )
        ]
    if n < NO_GRAVITY:
        return [_no_gravity(device, n, "at rest")]
    return [
        _say(
            "unit_suspect",
            Message(
                "Sensor {device}: acceleration at rest is {value:.2f} m/s², expected 9.81 m/s² (±10 "
                "%); check its calibration, or {FIX_ACC}.",
                device=device,
                value=n,
                FIX_ACC=_FIX_ACC,
            ),
            device,
            "error" if off > FAR_OFF else "warning",
        )
    ]


def _moving_acceleration(device: str, f: Facts) -> list[Notice]:
    """Check of the median over the recording, used without a still second: walking keeps it near gravity."""
    m = f.median_norm
    if 0.5 * GRAVITY <= m <= 2 * GRAVITY:
        return []
    if 0.7 <= m <= 1.5 and f.still_norm > NO_GRAVITY and f.acc_std < 1.5:
        return [
            _say(
                "unit_suspect",
                Message(
                    "Sensor {device}: acceleration is around {value:.2f}, expected about 9.81 m/s²; it "
                    "looks like g read as m/s²: {FIX_ACC}.",
                    device=device,
                    value=m,
                    FIX_ACC=_FIX_ACC,
                ),
                device,
            )
        ]
    if m < 0.5 * GRAVITY:
        return [_no_gravity(device, m, "mid-trial")]
    return [
        _say(
            "unit_suspect",
            Message(
                "Sensor {device}: acceleration is around {value:.1f} m/s², expected about 9.81 "
                "m/s²; {FIX_ACC}.",
                device=device,
                value=m,
                FIX_ACC=_FIX_ACC,
            ),
            device,
        )
    ]


def _no_gravity(device: str, n: float, when: str) -> Notice:
    return _say(
        "gravity_removed",
        Message(
            "Sensor {device}: acceleration {when} is {value:.2f} m/s², expected 9.81; gravity "
            "seems to have been removed, but it is needed for orientation. Export the raw "
            "acceleration (Acc, not FreeAcc).",
            device=device,
            when=when,
            value=n,
        ),
        device,
    )


def _rate(device: str, f: Facts) -> list[Notice]:
    if f.gyro_top is None:
        return []
    if f.gyro_top > GYRO_RANGE:
        return [
            _say(
                "unit_suspect",
                Message(
                    "Sensor {device}: angular rate reaches {gyro_top:.0f} rad/s, more than any sensor "
                    "measures ({GYRO_RANGE:.0f}); it is in deg/s but was read as rad/s: {FIX_GYR}.",
                    device=device,
                    gyro_top=f.gyro_top,
                    GYRO_RANGE=GYRO_RANGE,
                    FIX_GYR=_FIX_GYR,
                ),
                device,
            )
        ]
    rest_limit = LARGEST_BIAS if f.acc_std > WALKING_STD else GYRO_REST
    if f.still and f.still_gyro is not None and f.still_gyro > rest_limit:
        return [
            _say(
                "unit_suspect",
                Message(
                    "Sensor {device}: angular rate is {still_gyro:.2f} rad/s while the acceleration is "
                    "still, expected less than {rest:.2g}; it may be in deg/s but read as rad/s ({FIX_GYR}), "
                    "or the bias is broken.",
                    device=device,
                    still_gyro=f.still_gyro,
                    rest=rest_limit,
                    FIX_GYR=_FIX_GYR,
                ),
                device,
            )
        ]
    if f.acc_std > WALKING_STD and f.gyro_top < GYRO_LEAST:
        return [
            _say(
                "unit_suspect",
                Message(
                    "Sensor {device}: angular rate never exceeds {gyro_top:.1f} deg/s although the "
                    "sensor moves, expected more than 10; it is in rad/s but was read as deg/s: {FIX_GYR}.",
                    device=device,
                    gyro_top=np.degrees(f.gyro_top),
                    FIX_GYR=_FIX_GYR,
                ),
                device,
            )
        ]
    return []


def _sign(device: str, acc: Floats, quat: Floats) -> list[Notice]:
    """Check with the vendor's orientation (sensor → z up) that specific force points up on average."""
    good = is_complete(acc) & is_complete(quat)
    if np.count_nonzero(good) < 10:
        return []
    world = rotation.rotate(rotation.normalise(quat[good]), acc[good]).mean(axis=0)
    if world[2] > -0.5 * GRAVITY:
        return []
    return [
        _say(
            "gravity_sign",
            Message(
                "Sensor {device}: acceleration points down ({world:.1f} m/s² along the sensor's own "
                "vertical), expected up (+9.8) at rest; the exporting software reversed its sign. "
                "Export specific force.",
                device=device,
                world=world[2],
            ),
            device,
        )
    ]
