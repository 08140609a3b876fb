"""Calibration of a take in which nobody stands still: posture and forward axis of every sensor from walking.

The neutral posture of a foot is the one it has flat on the floor; that of any other segment is its mean
posture over straight walking, so its angles have a shape and a range and no level. Forward is the direction
of walking (docs/science/calibration.md, "Without standing").
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.calibration.anterior import AnteriorAxis, Method, list_axis_measures, weigh_axes
from sagittal.core.calibration.forward import ForwardMeasure, ForwardParams
from sagittal.core.calibration.gyro_pca import (
    WEAK_MARGIN,
    about_vertical,
    count_steps,
    flexion_axis,
    gait_margin,
    measure_flexion,
    sagittal_angle,
)
from sagittal.core.calibration.heading import (
    Complexes,
    HeadingParams,
    Part,
    acceleration_axis,
    horizontal_acceleration,
    nearest_sign,
    pendulum_agreement,
    step_time,
    stride_direction,
)
from sagittal.core.calibration.joint_turns import JointTurnParams, measure_joint_turns
from sagittal.core.calibration.mounting import read_declared_angle
from sagittal.core.calibration.sensor_in_walk import SensorInWalk, WalkRungParams, follow_sensor
from sagittal.core.calibration.standing import vertical_frame
from sagittal.core.calibration.walking import (
    TRUNK,
    WalkingParams,
    mean_turn,
    measure_turned_angle,
    moving_mask,
    straight_parts,
    turn_sensors,
    turning_mask,
)
from sagittal.core.errors import CalibrationError, Notice, SignalError
from sagittal.core.frames import FOOT, R_NEUTRAL, SHANK, SIDES, THIGH, Bools, Floats, Segment
from sagittal.core.fusion.attitude import AttitudeParams
from sagittal.core.rotation import about, find_vertical, from_matrix, multiply, rotate
from sagittal.core.signals.calibrated import CalibratedRecording, Calibration, SegmentCalibration
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import Window, find_runs

SWING_HZ: Final = 1.6
"""Low-pass under which the sensors of one leg are pushed forward together: a stride and its double."""

TOGETHER: Final = 0.3
"""Least correlation of the forward acceleration of two sensors of a leg from which one has its sign of the
other. Seen: foot and shank .83 to .96, shank and thigh .55 to .95 (neura_walk, qmt_fullbody, seven virtual
people)."""

CLEAR_SKEW: Final = 0.3
"""Skewness of a shank's rate from which its sign is clear: it swings forward faster than it ever falls back.
Seen: .59 to 1.8 on the same sets. Thighs have −.2 to 1.4: they tell nothing by themselves."""

FROM_WALKING: Final = (
    "Nobody stood still, so sensors were calibrated from walking: joint angles have ranges, no levels. Stand "
    "still for 3 seconds next time."
)

FROM_PAUSES: Final = (
    "The person only paused in mid-stride, so sensors were calibrated from walking: joint angles have "
    "ranges, no levels. Stand still for 3 seconds with both feet side by side next time."
)


@dataclass(frozen=True, eq=False)
class _Neutral:
    """A sensor with its neutral posture.

    Parameters
    ----------
    up : (3,) vertical in sensor axes in that posture. q : (n, 4) sensor to its own world, turned so that in
    that posture, over the reference part, its vertical frame faces x.
    """

    up: Floats
    q: Floats
    sensor: SensorInWalk


def calibrate_from_walking(
    recording: UniformRecording,
    walking: WalkingParams,
    heading: HeadingParams,
    attitude: AttitudeParams,
    params: WalkRungParams,
    method: Method,
    why: SignalError,
    rests: tuple[Window, ...],
    forward: ForwardParams,
    joint_turns: JointTurnParams,
) -> CalibratedRecording:
    """Calibrate without a standing.

    Parameters
    ----------
    why : what was wrong with standing; raised when walking cannot replace it. rests : pauses in mid-stride.

    Returns
    -------
    CalibratedRecording with `posture` "walking". A sensor whose forward cannot be found is left out with a
    notice.

    Raises
    ------
    SignalError `why`, where nobody walks for long enough either. CalibrationError of the first sensor when
    none can be calibrated.
    """
    rate = recording.rate_hz
    moving = moving_mask(recording, walking)
    walks = [r for r in find_runs(moving) if r[1] - r[0] >= params.least_s * rate]
    if not walks:
        raise why
    straight = moving
    sensors: dict[Segment, SensorInWalk] = {}
    # where the person turns is known once a sensor's vertical is
    for segments in (turn_sensors(recording), list(recording.sensors)):
        sensors = {
            s: x
            for s in segments
            if (x := follow_sensor(s, recording.sensors[s], walks, straight, rate, attitude, params))
        }
        if not all(s in sensors for s in turn_sensors(recording)):
            raise why
        bias, q = {s: x.gyro_bias for s, x in sensors.items()}, {s: x.q for s, x in sensors.items()}
        turning = turning_mask(recording, bias, q, walking) & moving
        straight = moving & ~turning
    parts = straight_parts(moving, turning, rate, walking)
    if not parts:
        raise why
    home = max(parts, key=lambda p: p[1] - p[0])
    reach = heading.reach_s * rate
    near = [p for p in parts if abs(0.5 * (p[0] + p[1] - home[0] - home[1])) <= reach]
    bearing = _bearings(recording, sensors, near, home)
    neutral = {s: _find_neutral(s, x, near, home) for s, x in sensors.items()}
    found, notices = _find_forward(recording, neutral, near, bearing, heading, method, forward)
    joints = measure_joint_turns(
        recording,
        {s: neutral[s].sensor.gyro_bias for s in found},
        {s: neutral[s].q for s in found},
        near,
        joint_turns,
    )
    found = weigh_axes(found, joints, forward)
    notices += [n for f in found.values() for n in f.notices]
    notices.append(Notice("from_walking", FROM_PAUSES if rests else FROM_WALKING))
    zero = (home[0] / rate, home[1] / rate)
    at = round(0.5 * (zero[0] + zero[1]) * rate)
    calibration = Calibration(
        segments={s: _mounted(neutral[s], f, at) for s, f in found.items()},
        rest=rests,
        walking=tuple((a / rate, b / rate) for a, b in parts),
        zero=zero,
        turning=turning,
        method=method,
        notices=tuple(notices),
        diagnostics={s: {"method": f.method, "score": f.score, **f.facts} for s, f in found.items()},
        straight_steps=_straight_steps(found, neutral, near),
        posture="walking",
    )
    return CalibratedRecording(recording, calibration)


def _bearings(
    recording: UniformRecording, sensors: Mapping[Segment, SensorInWalk], parts: list[Part], home: Part
) -> list[float]:
    """Turn of each part about the vertical since the reference part, rad."""
    show = turn_sensors(recording)
    turns = []
    for p in parts:
        each = []
        for s in show:
            q = sensors[s].q
            first = q[home[0]]
            each.append(np.exp(1j * (mean_turn(q, first, p) - mean_turn(q, first, home))))
        turns.append(float(np.angle(np.mean(each))))
    return turns


def _find_neutral(segment: Segment, sensor: SensorInWalk, parts: list[Part], home: Part) -> _Neutral:
    """Posture of a foot that is flat, or the mean of straight walking."""
    q, n = sensor.q, len(sensor.q)
    seen, here = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    for a, b in parts:
        seen[a:b] = True
    here[home[0] : home[1]] = True
    if segment in FOOT.values() and len(sensor.flats) >= 3:
        flat = np.zeros(n, np.bool_)
        flat[sensor.flats] = True
        up = np.median(find_vertical(q[flat]), axis=0)
        here = here & flat if (here & flat).any() else here
    else:
        up = find_vertical(q[seen]).mean(axis=0)
    up = up / np.linalg.norm(up)
    facing = from_matrix(R_NEUTRAL @ vertical_frame(up))
    turned = float(np.angle(np.exp(1j * measure_turned_angle(q[here], facing)).mean()))
    return _Neutral(up, multiply(about(2, -turned), q), sensor)


def _find_forward(
    recording: UniformRecording,
    neutral: Mapping[Segment, _Neutral],
    parts: list[Part],
    bearing: list[float],
    params: HeadingParams,
    method: Method,
    weights: ForwardParams,
) -> tuple[dict[Segment, AnteriorAxis], list[Notice]]:
    """Anterior axis of every sensor whose sign can be told, by itself, and what is to be said of others."""
    found: dict[Segment, AnteriorAxis] = {}
    notices: list[Notice] = []
    pushed: dict[Segment, Floats] = {}
    failed: CalibrationError | None = None
    mask = _mask(len(recording.t_s), parts)
    for segment in _in_order(neutral):
        x, signals = neutral[segment], recording.sensors[segment]
        a = horizontal_acceleration(x.q, signals.acc)
        vaulting = 0.0
        R = vertical_frame(x.up)
        try:
            strides, seen = None, None
            if method == "gyro_pca" and segment not in TRUNK:
                pca = flexion_axis(signals.gyr[mask] - x.sensor.gyro_bias, R, segment)
                axis, share = -pca.gamma, pca.rho
            else:
                steps_s = None
                if segment in TRUNK:
                    upwards = rotate(x.q, signals.acc)[:, 2]
                    steps_s = [step_time(upwards[p[0] : p[1]], recording.rate_hz) for p in parts]
                seen = acceleration_axis(a, parts, bearing, recording.rate_hz, params, steps_s)
                axis, share = seen.angle, seen.score
                strides = stride_direction(a, x.sensor.flats, parts, bearing, recording.rate_hz, params)
                if strides is not None:
                    axis, share = strides.angle, strides.score
                if steps_s is not None:
                    vaulting = pendulum_agreement(
                        a, upwards, axis, parts, bearing, recording.rate_hz, steps_s
                    )
            forward = _push(a, axis, parts, bearing, recording.rate_hz)
            angle, how, own = _sign(
                segment, axis, strides is not None, recording, x, mask, forward, pushed, vaulting,
                params.pendulum,
            )  # fmt: skip
        except CalibrationError as error:
            failed = failed or error
            notices.append(Notice(error.code, error.message, sensor=segment))
            continue
        pushed[segment] = forward if np.cos(angle - axis) > 0.0 else -forward
        heard: tuple[ForwardMeasure, ...]
        if seen is None:
            heard, mirror = (ForwardMeasure("gyro_pca", angle, weights.pca_sd, weights.pca_doubt),), None
        else:
            pca = measure_flexion(signals.gyr[mask] - x.sensor.gyro_bias, R)
            heard, mirror = list_axis_measures(segment, angle, seen, pca, weights)
        if strides is not None:
            heard = (ForwardMeasure("strides", angle, weights.strides_sd, weights.strides_doubt),)
        found[segment] = AnteriorAxis(
            angle,
            method if segment not in TRUNK else "walking_direction",
            share,
            own,
            {"sign": how},
            measures=heard,
            mirror=mirror,
            kept=seen is None or strides is not None,
        )
    if not found and failed is not None:
        raise failed
    return found, notices


def _in_order(worn: Mapping[Segment, object]) -> Iterator[Segment]:
    """Sensors that tell their sign by themselves first: shanks, then feet, thighs, the trunk."""
    for group in (SHANK, FOOT, THIGH):
        yield from (group[side] for side in SIDES if group[side] in worn)
    yield from (s for s in TRUNK if s in worn)


def _sign(
    segment: Segment,
    axis: float,
    directed: bool,
    recording: UniformRecording,
    x: _Neutral,
    mask: Bools,
    forward: Floats,
    pushed: Mapping[Segment, Floats],
    vaulting: float,
    least_vaulting: float,
) -> tuple[float, str, tuple[Notice, ...]]:
    """The end of the axis that is forward, what told it, and what to say.

    Parameters
    ----------
    directed : the axis is the direction of a foot's strides, which has a sign.

    Raises
    ------
    CalibrationError `forward_unknown`, `pelvis_heading_unknown`.
    """
    R = vertical_frame(x.up)
    written = read_declared_angle(recording.mounting.get(segment, ""), R, segment)
    if written is not None:
        return nearest_sign(axis, written), "declared", ()
    if directed:
        return axis, "strides", ()
    if segment in TRUNK:
        if segment == "pelvis" and abs(vaulting) >= least_vaulting:
            return (axis if vaulting > 0 else nearest_sign(axis, axis + np.pi)), "pendulum", ()
        raise CalibrationError(
            "pelvis_heading_unknown",
            f"{segment}: which way it faces is not known without standing. Stand still for 3 s before "
            "walking, or declare the mounting, for example “sacrum, face backwards”.",
            sensor=segment,
        )
    for other, theirs in pushed.items():
        if other[-1] == segment[-1] and np.ptp(forward) > 0.0 and np.ptp(theirs) > 0.0:
            together = float(np.corrcoef(forward, theirs)[0, 1])
            if abs(together) >= TOGETHER:
                return (axis if together > 0 else nearest_sign(axis, axis + np.pi)), other, ()
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
            f"{segment}: which way is forward cannot be told from it alone. Wear a sensor on the shank or "
            "foot of that leg, or declare the mounting.",
            sensor=segment,
        )
    weak = () if clear else (_weak(segment),)
    return (axis if margin > 0 else nearest_sign(axis, axis + np.pi)), "gait", weak


def _push(a: Complexes, axis: float, parts: list[Part], bearing: list[float], rate_hz: float) -> Floats:
    """Slow acceleration along an axis over all parts, one after the other, each without its mean."""
    pieces = []
    for (start, end), turn in zip(parts, bearing, strict=True):
        x = low_pass((a[start:end] * np.exp(-1j * (axis + turn))).real, SWING_HZ, rate_hz)
        pieces.append(x - x.mean())
    return np.concatenate(pieces)


def _weak(segment: Segment) -> Notice:
    return Notice(
        "calibration_sign_weak",
        f"{segment}: forward and backward are hard to tell apart in this walk. Declare the mounting, or "
        "check the sign of its angles.",
        sensor=segment,
    )


def _mask(n: int, parts: list[Part]) -> Bools:
    mask = np.zeros(n, np.bool_)
    for a, b in parts:
        mask[a:b] = True
    return mask


def _mounted(x: _Neutral, found: AnteriorAxis, at: int) -> SegmentCalibration:
    return SegmentCalibration(
        R_segment_sensor=about_vertical(-found.angle) @ vertical_frame(x.up),
        gyro_bias=x.sensor.gyro_bias,
        rest_norm=x.sensor.norm,
        method=found.method,
        score=min(1.0, max(0.0, found.score)),
        start_q=multiply(about(2, -found.angle), x.q[at]),
        forward_sd=found.sd,
    )


def _straight_steps(
    found: Mapping[Segment, AnteriorAxis], neutral: Mapping[Segment, _Neutral], parts: list[Part]
) -> int | None:
    leg = next((s for s in found if s not in TRUNK), None)
    if leg is None:
        return None
    x = neutral[leg]
    up, R = find_vertical(x.q), about_vertical(-found[leg].angle) @ vertical_frame(x.up)
    return count_steps(sagittal_angle(up, R), _mask(len(x.q), parts))
