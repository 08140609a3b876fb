"""Calibration of a recording without quiet standing: posture and forward axis of every sensor from walking.

The neutral posture of a foot is foot-flat; that of any other segment is its mean posture over straight
walking, so its angles have a meaningful shape and range but no absolute level. Forward is the direction of
walking (docs/science/calibration.md, "Without standing").
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from sagittal.core.calibration.anterior import AnteriorAxis, Method, weigh_axes
from sagittal.core.calibration.forward import ForwardParams
from sagittal.core.calibration.forward_in_walk import NeutralSensor, find_forward_in_walk, mask_of
from sagittal.core.calibration.gyro_pca import (
    about_vertical,
    count_steps,
    sagittal_angle,
)
from sagittal.core.calibration.heading import (
    HeadingParams,
    Part,
)
from sagittal.core.calibration.joint_turns import JointTurnParams, measure_joint_turns
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
from sagittal.core.errors import Notice, SignalError
from sagittal.core.frames import FOOT, R_NEUTRAL, Bools, Segment
from sagittal.core.fusion.attitude import AttitudeParams
from sagittal.core.rotation import about, find_vertical, from_matrix, multiply
from sagittal.core.signals.calibrated import CalibratedRecording, Calibration, SegmentCalibration
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import Window, find_runs

FROM_WALKING: Final = (
    "No quiet standing detected, so the sensors were calibrated from walking: joint angle ranges are "
    "valid, absolute levels are not. Stand still for 3 seconds next time."
)

FROM_PAUSES: Final = (
    "The person only paused mid-stride, so the sensors were calibrated from walking: joint angle ranges "
    "are valid, absolute levels are not. Stand still for 3 seconds with both feet side by side next time."
)


def calibrate_from_walking(
    recording: UniformRecording,
    walking: WalkingParams,
    heading: HeadingParams,
    attitude: AttitudeParams,
    params: WalkRungParams,
    method: Method,
    reason: SignalError,
    rests: tuple[Window, ...],
    forward: ForwardParams,
    joint_turns: JointTurnParams,
) -> CalibratedRecording:
    """Calibrate without quiet standing.

    Parameters
    ----------
    reason : the reason for rejecting standing; raised if walking cannot replace it. rests : pauses in
    mid-stride.

    Returns
    -------
    CalibratedRecording with `posture` "walking". A sensor whose forward axis cannot be determined is omitted
    with a notice.

    Raises
    ------
    SignalError `reason` if there is no sufficiently long walk either. CalibrationError of the first sensor if
    none can be calibrated.
    """
    rate = recording.rate_hz
    sensors, moving, turning = _follow_sensors(recording, walking, attitude, params, reason)
    parts = straight_parts(moving, turning, rate, walking)
    if not parts:
        raise reason
    home = max(parts, key=lambda p: p[1] - p[0])
    reach = heading.reach_s * rate
    near = [p for p in parts if abs(0.5 * (p[0] + p[1] - home[0] - home[1])) <= reach]
    bearing = _bearings(recording, sensors, near, home)
    neutral = {s: _find_neutral(s, x, near, home) for s, x in sensors.items()}
    axes, notices = find_forward_in_walk(recording, neutral, near, bearing, heading, method, forward)
    joints = measure_joint_turns(
        recording,
        {s: neutral[s].sensor.gyro_bias for s in axes},
        {s: neutral[s].q for s in axes},
        near,
        joint_turns,
    )
    axes = weigh_axes(axes, joints, forward)
    notices += [n for f in axes.values() for n in f.notices]
    notices.append(Notice("from_walking", FROM_PAUSES if rests else FROM_WALKING))
    zero = (home[0] / rate, home[1] / rate)
    middle = round(0.5 * (zero[0] + zero[1]) * rate)
    calibration = Calibration(
        segments={s: _mounted(neutral[s], f, middle) for s, f in axes.items()},
        rest=rests,
        walking=tuple((a / rate, b / rate) for a, b in parts),
        zero=zero,
        turning=turning,
        method=method,
        notices=tuple(notices),
        diagnostics={s: {"method": f.method, "score": f.score, **f.facts} for s, f in axes.items()},
        straight_steps=_straight_steps(axes, neutral, near),
        posture="walking",
    )
    return CalibratedRecording(recording, calibration)


def _follow_sensors(
    recording: UniformRecording,
    walking: WalkingParams,
    attitude: AttitudeParams,
    params: WalkRungParams,
    reason: SignalError,
) -> tuple[dict[Segment, SensorInWalk], Bools, Bools]:
    """Track every sensor through the walks; also the samples (n,) of movement and of turns."""
    rate = recording.rate_hz
    moving = moving_mask(recording, walking)
    walks = [r for r in find_runs(moving) if r[1] - r[0] >= params.least_s * rate]
    if not walks:
        raise reason
    straight, turning = moving, moving
    sensors: dict[Segment, SensorInWalk] = {}
    # where the person turns is known once a sensor's vertical is
    for segments in (turn_sensors(recording), list(recording.sensors)):
        sensors = {
            s: x
            for s in segments
            if (x := follow_sensor(s, recording.sensors[s], walks, straight, rate, attitude, params))
        }
        if not all(s in sensors for s in turn_sensors(recording)):
            raise reason
        bias, q = {s: x.gyro_bias for s, x in sensors.items()}, {s: x.q for s, x in sensors.items()}
        turning = turning_mask(recording, bias, q, walking) & moving
        straight = moving & ~turning
    return sensors, moving, turning


def _bearings(
    recording: UniformRecording, sensors: Mapping[Segment, SensorInWalk], parts: list[Part], home: Part
) -> list[float]:
    """Heading change of each part relative to the reference part, rad."""
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


def _find_neutral(segment: Segment, sensor: SensorInWalk, parts: list[Part], home: Part) -> NeutralSensor:
    """Posture of a flat foot, or mean posture of straight walking."""
    q, n = sensor.q, len(sensor.q)
    walking_mask, reference_mask = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    for a, b in parts:
        walking_mask[a:b] = True
    reference_mask[home[0] : home[1]] = True
    if segment in FOOT.values() and len(sensor.flats) >= 3:
        flat = np.zeros(n, np.bool_)
        flat[sensor.flats] = True
        up = np.median(find_vertical(q[flat]), axis=0)
        reference_mask = reference_mask & flat if (reference_mask & flat).any() else reference_mask
    else:
        up = find_vertical(q[walking_mask]).mean(axis=0)
    up = up / np.linalg.norm(up)
    facing = from_matrix(R_NEUTRAL @ vertical_frame(up))
    turned = float(np.angle(np.exp(1j * measure_turned_angle(q[reference_mask], facing)).mean()))
    return NeutralSensor(up, multiply(about(2, -turned), q), sensor)


def _mounted(x: NeutralSensor, found: AnteriorAxis, sample: int) -> SegmentCalibration:
    return SegmentCalibration(
        R_segment_sensor=about_vertical(-found.angle) @ vertical_frame(x.up),
        gyro_bias=x.sensor.gyro_bias,
        rest_norm=x.sensor.norm,
        method=found.method,
        score=min(1.0, max(0.0, found.score)),
        start_q=multiply(about(2, -found.angle), x.q[sample]),
        forward_sd=found.sd,
    )


def _straight_steps(
    found: Mapping[Segment, AnteriorAxis], neutral: Mapping[Segment, NeutralSensor], parts: list[Part]
) -> int | None:
    leg = next((s for s in found if s not in TRUNK), None)
    if leg is None:
        return None
    x = neutral[leg]
    up, R = find_vertical(x.q), about_vertical(-found[leg].angle) @ vertical_frame(x.up)
    return count_steps(sagittal_angle(up, R), mask_of(len(x.q), parts))
