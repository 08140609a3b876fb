"""History of a device: its latest check compared with the earlier ones (docs/science/devices.md, "Limits").

Limits are based on the tolerance of the analysis and on the behaviour of intact devices, not on the
manufacturer's specifications: every value includes the wearer's own movement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, radians
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.quality.devices import DeviceCheck

Quantity = Literal["gyro_bias", "scale", "scale_off", "gyro_noise", "acc_noise"]
"""scale: against earlier checks in the same posture; scale_off: against gravity."""

BIAS_MOVED: Final = radians(0.8)
"""rad/s. 64 of 65 checks of three worn devices were within 0.8 °/s of their median; 16 K at 0.05 °/s per K
(docs/science/devices.md, "Limits")."""

SCATTER: Final = 2.2
"""Times the median distance of the earlier biases from their median: 99 % of a normal scatter in three axes
is within (3.37 by 1.54 standard deviations). So a bias that differs at every start is not told for it."""

SCALE_MOVED: Final = 0.02
"""20 mg: 20 K at 1 mg per K (docs/science/devices.md, "Limits")."""

SCALE_OFF: Final = 0.05
"""Half of what the analysis refuses (core/quality/suspicion.py)."""

GYRO_NOISE_ROSE: Final = 3.0
ACC_NOISE_ROSE: Final = 2.0
"""Times the median; the largest of 65 checks of worn devices were 2.7 and 1.4 times theirs."""

SAME_POSTURE: Final = cos(radians(30.0))
"""Verticals closer than this are one posture of the device (our choice)."""

SAME_RATE: Final = 0.05
"""Noise is compared at one rate, within this share: devices filter by their rate (our choice)."""


@dataclass(frozen=True)
class DeviceFinding:
    """A limit exceeded in the latest check.

    Parameters
    ----------
    value, limit : rad/s for a bias, a fraction for a scale, a multiple of the usual value for noise. since :
        index of the last earlier check within the limit, None for findings based on a single check.
    """

    quantity: Quantity
    value: float
    limit: float
    since: int | None


@dataclass(frozen=True, eq=False)
class DeviceCourse:
    """Assessment of a device from all its checks.

    Parameters
    ----------
    compared : number of earlier checks compared with the latest; 0 = no comparison possible. newest : index
        of the latest check with a measurement, None without any.
    usual_bias : (3,) median of the earlier biases, rad/s. bias_limit : reporting limit of the deviation from
        it. usual_scale : median of the earlier scales in the same posture. None = no comparison possible.
    """

    newest: int | None
    compared: int
    findings: tuple[DeviceFinding, ...] = ()
    usual_bias: Floats | None = None
    bias_limit: float = BIAS_MOVED
    usual_scale: float | None = None


def follow_device(checks: Sequence[DeviceCheck]) -> DeviceCourse:
    """Compare the latest check of a device with the median of the earlier ones.

    Parameters
    ----------
    checks : of one device, oldest first; those without a measurement are skipped.

    Notes
    -----
    A median follows a step once half of the checks show it; the new level then counts as normal. The limit
    for a bias change combines `BIAS_MOVED`, twice the possible rotation of the wearer in both rests, and its
    own scatter.
    """
    measured = [i for i, check in enumerate(checks) if check.reason is None]
    if not measured:
        return DeviceCourse(None, 0)
    *earlier, last = measured
    new = checks[last]
    assert new.gyro_bias is not None  # noqa: S101 (no reason: measured)
    assert new.gravity_scale is not None  # noqa: S101 (the same)
    findings = []
    off = abs(new.gravity_scale - 1.0)
    if off > SCALE_OFF:
        findings.append(DeviceFinding("scale_off", new.gravity_scale - 1.0, SCALE_OFF, None))
    earlier_checks = [checks[i] for i in earlier]
    biases = [c.gyro_bias for c in earlier_checks if c.gyro_bias is not None]
    usual, middle, limit = None, None, BIAS_MOVED
    if biases:
        usual = np.median(biases, axis=0)
        unsure = 2.0 * (
            (new.bias_error or 0.0) + float(np.median([c.bias_error or 0.0 for c in earlier_checks]))
        )
        deviations = [float(np.linalg.norm(b - usual)) for b in (*biases, new.gyro_bias)]
        scatter = SCATTER * float(np.median(deviations[:-1]))
        limit = max(BIAS_MOVED, unsure, scatter)
        findings += _beyond("gyro_bias", deviations, limit, earlier)
    lying = [i for i in earlier if _in_same_posture(checks[i], new)]
    scales = [checks[i].gravity_scale or 1.0 for i in lying]
    if scales:
        middle = float(np.median(scales))
        moved = [x / middle - 1.0 for x in (*scales, new.gravity_scale)]
        findings += _beyond("scale", moved, SCALE_MOVED, lying)
    alike = [i for i in earlier if abs(checks[i].rate_hz / new.rate_hz - 1.0) < SAME_RATE]
    findings += _louder("gyro_noise", GYRO_NOISE_ROSE, checks, alike, new)
    findings += _louder("acc_noise", ACC_NOISE_ROSE, checks, alike, new)
    return DeviceCourse(last, len(earlier), tuple(findings), usual, limit, middle)


def _louder(
    quantity: Literal["gyro_noise", "acc_noise"],
    limit: float,
    checks: Sequence[DeviceCheck],
    alike: Sequence[int],
    new: DeviceCheck,
) -> list[DeviceFinding]:
    measured = [i for i in alike if getattr(checks[i], quantity) is not None]
    now = getattr(new, quantity)
    if now is None or not measured:
        return []
    values = [float(getattr(checks[i], quantity)) for i in measured]
    middle = float(np.median(values))
    return _beyond(quantity, [x / middle for x in (*values, float(now))], limit, measured)


def _beyond(
    quantity: Quantity, values: Sequence[float], limit: float, earlier: Sequence[int]
) -> list[DeviceFinding]:
    """Finding for the last of the values if it exceeds its limit, with the last earlier check that did
    not.
    """
    if abs(values[-1]) <= limit:
        return []
    inside = [i for i, value in zip(earlier, values, strict=False) if abs(value) <= limit]
    return [DeviceFinding(quantity, values[-1], limit, inside[-1] if inside else None)]


def _in_same_posture(a: DeviceCheck, b: DeviceCheck) -> bool:
    return a.up is not None and b.up is not None and float(a.up @ b.up) > SAME_POSTURE
