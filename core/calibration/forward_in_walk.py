"""Anterior axis of sensors without quiet standing: axes from straight walking, and their signs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.calibration.anterior import AnteriorAxis, Method, list_axis_measures
from sagittal.core.calibration.forward import ForwardMeasure, ForwardParams
from sagittal.core.calibration.gyro_pca import (
    WEAK_MARGIN,
    about_vertical,
    flexion_axis,
    gait_margin,
    measure_flexion,
    sagittal_angle,
)
from sagittal.core.calibration.heading import (
    Complexes,
    HeadingParams,
    Part,
    WalkingDirection,
    acceleration_axis,
    horizontal_acceleration,
    nearest_sign,
    pendulum_agreement,
    step_time,
    stride_direction,
)
from sagittal.core.calibration.mounting import read_declared_angle
from sagittal.core.calibration.sensor_in_walk import SensorInWalk
from sagittal.core.calibration.standing import vertical_frame
from sagittal.core.calibration.walking import (
    TRUNK,
)
from sagittal.core.errors import CalibrationError, Notice
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import find_vertical, rotate
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.recording import UniformRecording

SWING_HZ: Final = 1.6
"""Low-pass under which the sensors of one leg are pushed forward together: a stride and its double."""

TOGETHER: Final = 0.3
"""Least correlation of the forward acceleration of two sensors of a leg from which one has its sign of the
other. Seen: foot and shank .83 to .96, shank and thigh .55 to .95 (neura_walk, qmt_fullbody, seven virtual
people)."""

CLEAR_SKEW: Final = 0.3
"""Skewness of a shank's rate from which its sign is clear: it swings forward faster than it ever falls back.
Seen: .59 to 1.8 on the same sets. Thighs have −.2 to 1.4: they tell nothing by themselves."""


@dataclass(frozen=True, eq=False)
class NeutralSensor:
    """A sensor with its neutral posture.

    Parameters
    ----------
    up : (3,) vertical in sensor axes in that posture. q : (n, 4) sensor to its own world frame, rotated so
    that in that posture its vertical frame faces x over the reference part.
    """

    up: Floats
    q: Floats
    sensor: SensorInWalk


def find_forward_in_walk(
    recording: UniformRecording,
    neutral: Mapping[Segment, NeutralSensor],
    parts: list[Part],
    bearing: list[float],
    params: HeadingParams,
    method: Method,
    weights: ForwardParams,
) -> tuple[dict[Segment, AnteriorAxis], list[Notice]]:
    """Anterior axis of every sensor whose sign can be determined independently, and notices about the
    others.
    """
    axes: dict[Segment, AnteriorAxis] = {}
    notices: list[Notice] = []
    pushed: dict[Segment, Floats] = {}
    failed: CalibrationError | None = None
    mask = mask_of(len(recording.t_s), parts)
    for segment in _in_order(neutral):
        x = neutral[segment]
        by_gyro = method == "gyro_pca" and segment not in TRUNK
        try:
            axis = _find_axis(segment, x, recording, parts, bearing, mask, params, by_gyro)
            angle, evidence, own = _sign(segment, axis, recording, x, mask, pushed, params.pendulum)
        except CalibrationError as error:
            failed = failed or error
            notices.append(Notice(error.code, error.message, sensor=segment))
            continue
        pushed[segment] = axis.push if np.cos(angle - axis.angle) > 0.0 else -axis.push
        heard, mirror = _list_measures(segment, angle, axis, recording, x, mask, weights)
        axes[segment] = AnteriorAxis(
            angle,
            method if segment not in TRUNK else "walking_direction",
            axis.share,
            own,
            {"sign": evidence},
            measures=heard,
            mirror=mirror,
            kept=axis.seen is None or axis.directed,
        )
    if not axes and failed is not None:
        raise failed
    return axes, notices


@dataclass(frozen=True, eq=False)
class _WalkedAxis:
    """Axis of one sensor whose forward end is not yet determined.

    Parameters
    ----------
    angle : rad. share : its distinctness. directed : the direction of a foot's strides, which has a sign.
    seen : axis of the acceleration, None with gyro PCA. vaulting : agreement of a trunk's vertical movement
    with the direction, 0 for other segments. push : slow acceleration along the axis.
    """

    angle: float
    share: float
    directed: bool
    seen: WalkingDirection | None
    vaulting: float
    push: Floats


def _find_axis(
    segment: Segment,
    x: NeutralSensor,
    recording: UniformRecording,
    parts: list[Part],
    bearing: list[float],
    mask: Bools,
    params: HeadingParams,
    by_gyro: bool,
) -> _WalkedAxis:
    """The axis by gyro PCA, by strides, or by the acceleration."""
    signals, rate = recording.sensors[segment], recording.rate_hz
    a = horizontal_acceleration(x.q, signals.acc)
    if by_gyro:
        pca = flexion_axis(signals.gyr[mask] - x.sensor.gyro_bias, vertical_frame(x.up), segment)
        push = _push(a, -pca.gamma, parts, bearing, rate)
        return _WalkedAxis(-pca.gamma, pca.rho, False, None, 0.0, push)
    steps_s, vaulting = None, 0.0
    if segment in TRUNK:
        upwards = rotate(x.q, signals.acc)[:, 2]
        steps_s = [step_time(upwards[p[0] : p[1]], rate) for p in parts]
    acceleration = acceleration_axis(a, parts, bearing, rate, params, steps_s)
    strides = stride_direction(a, x.sensor.flats, parts, bearing, rate, params)
    best = acceleration if strides is None else strides
    if steps_s is not None:
        vaulting = pendulum_agreement(a, upwards, best.angle, parts, bearing, rate, steps_s)
    push = _push(a, best.angle, parts, bearing, rate)
    return _WalkedAxis(best.angle, best.score, strides is not None, acceleration, vaulting, push)


def _list_measures(
    segment: Segment,
    angle: float,
    axis: _WalkedAxis,
    recording: UniformRecording,
    x: NeutralSensor,
    mask: Bools,
    weights: ForwardParams,
) -> tuple[tuple[ForwardMeasure, ...], ForwardMeasure | None]:
    """Measures of the forward axis, and the one for use by the other side."""
    if axis.seen is None:
        return (ForwardMeasure("gyro_pca", angle, weights.pca_sd, weights.pca_doubt),), None
    gyr = recording.sensors[segment].gyr[mask] - x.sensor.gyro_bias
    pca = measure_flexion(gyr, vertical_frame(x.up))
    heard, mirror = list_axis_measures(segment, angle, axis.seen, pca, weights)
    if axis.directed:
        heard = (ForwardMeasure("strides", angle, weights.strides_sd, weights.strides_doubt),)
    return heard, mirror


def _in_order(sensors: Mapping[Segment, object]) -> Iterator[Segment]:
    """Sensors in the order in which their sign can be determined: shanks first, then feet, thighs, trunk."""
    for group in (SHANK, FOOT, THIGH):
        yield from (group[side] for side in SIDES if group[side] in sensors)
    yield from (s for s in TRUNK if s in sensors)


def _sign(
    segment: Segment,
    walked: _WalkedAxis,
    recording: UniformRecording,
    x: NeutralSensor,
    mask: Bools,
    pushed: Mapping[Segment, Floats],
    least_vaulting: float,
) -> tuple[float, str, tuple[Notice, ...]]:
    """Forward end of the axis, the evidence used, and notices.

    Raises
    ------
    CalibrationError `forward_unknown`, `pelvis_heading_unknown`.
    """
    axis, vaulting, forward = walked.angle, walked.vaulting, walked.push
    R = vertical_frame(x.up)
    written = read_declared_angle(recording.mounting.get(segment, ""), R, segment)
    if written is not None:
        return nearest_sign(axis, written), "declared", ()
    if walked.directed:
        return axis, "strides", ()
    if segment in TRUNK:
        if segment == "pelvis" and abs(vaulting) >= least_vaulting:
            return (axis if vaulting > 0 else nearest_sign(axis, axis + np.pi)), "pendulum", ()
        raise CalibrationError(
            "pelvis_heading_unknown",
            Message(
                "{segment}: its facing direction is unknown without quiet standing. Stand still for 3 s "
                "before walking, or declare the placement, for example “sacrum, face backwards”.",
                segment=segment,
            ),
            sensor=segment,
        )
    for neighbour, theirs in pushed.items():
        if neighbour[-1] == segment[-1] and np.ptp(forward) > 0.0 and np.ptp(theirs) > 0.0:
            together = float(np.corrcoef(forward, theirs)[0, 1])
            if abs(together) >= TOGETHER:
                return (axis if together > 0 else nearest_sign(axis, axis + np.pi)), neighbour, ()
    if segment in SHANK.values():
        signals = recording.sensors[segment]
        rate = (signals.gyr - x.sensor.gyro_bias)[mask] @ (about_vertical(-axis) @ R)[2]
        skew = float(np.mean((rate - rate.mean()) ** 3) / max(float(rate.std()) ** 3, 1e-12))
        clear, margin = abs(skew) >= CLEAR_SKEW, skew
    elif segment in FOOT.values():
        up = find_vertical(x.q)
        margin = gait_margin(sagittal_angle(up, about_vertical(-axis) @ R), mask, segment)
        clear = abs(margin) >= WEAK_MARGIN
    else:
        raise CalibrationError(
            "forward_unknown",
            Message(
                "{segment}: the forward direction cannot be determined from this sensor alone. Attach a "
                "sensor to the shank or foot of that leg, or declare the placement.",
                segment=segment,
            ),
            sensor=segment,
        )
    weak = () if clear else (_weak(segment),)
    return (axis if margin > 0 else nearest_sign(axis, axis + np.pi)), "gait", weak


def _push(a: Complexes, axis: float, parts: list[Part], bearing: list[float], rate_hz: float) -> Floats:
    """Slow acceleration along an axis over all parts, concatenated, each with its mean removed."""
    pieces = []
    for (start, end), turn in zip(parts, bearing, strict=True):
        x = low_pass((a[start:end] * np.exp(-1j * (axis + turn))).real, SWING_HZ, rate_hz)
        pieces.append(x - x.mean())
    return np.concatenate(pieces)


def _weak(segment: Segment) -> Notice:
    return Notice(
        "calibration_sign_weak",
        Message(
            "{segment}: forward and backward are hard to distinguish in this walk. Declare the "
            "placement, or check the sign of its angles.",
            segment=segment,
        ),
        sensor=segment,
    )


def mask_of(n: int, parts: list[Part]) -> Bools:
    """Mask (n,) of the samples in the parts."""
    mask = np.zeros(n, np.bool_)
    for a, b in parts:
        mask[a:b] = True
    return mask
