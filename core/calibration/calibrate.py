"""The calibration stage: rest → vertical and bias, walking → anterior axis of every segment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees, radians

import numpy as np

from sagittal.core.calibration.anterior import (
    AnteriorAxis,
    Method,
    find_anterior_axis,
    weigh_axes,
)
from sagittal.core.calibration.forward import ForwardParams
from sagittal.core.calibration.from_walking import calibrate_from_walking
from sagittal.core.calibration.functional import (
    FunctionalMovements,
    FunctionalParams,
    find_functional_axes,
    find_functional_movements,
)
from sagittal.core.calibration.gyro_pca import about_vertical, count_steps, sagittal_angle, sagittal_course
from sagittal.core.calibration.heading import HeadingParams, Part, step_time
from sagittal.core.calibration.joint_turns import JointTurnParams, measure_joint_turns
from sagittal.core.calibration.score import ScoreParams
from sagittal.core.calibration.sensor_in_walk import WalkRungParams
from sagittal.core.calibration.standing import (
    LEG_AHEAD,
    SensorAtRest,
    choose_rest,
    drop_pauses,
    find_rests,
    measure_leg_ahead,
    stand_all,
    vertical_frame,
)
from sagittal.core.calibration.walking import (
    TRUNK,
    WalkingParams,
    mean_turn,
    moving_mask,
    straight_parts,
    turn_sensors,
    turning_mask,
)
from sagittal.core.calibration.ways import CalibrationWalk
from sagittal.core.errors import CalibrationError, Notice, SignalError
from sagittal.core.frames import R_NEUTRAL, Bools, Floats, Segment
from sagittal.core.fusion.attitude import AttitudeParams, estimate_orientation
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.core.rotation import find_vertical, from_matrix, rotate
from sagittal.core.signals.calibrated import CalibratedRecording, Calibration, SegmentCalibration
from sagittal.core.signals.held_samples import HeldSeries
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import RestParams, Window

FACING = radians(20.0)
"""Turn between standing and the first straight part that still counts as facing the walk (our choice)."""

FEW_STEPS = 8
"""Steps below which calibration says how few there were (docs/science/calibration.md, "Parameters")."""

NO_STANDING = (
    "No quiet standing detected: the person only paused mid-stride. Ask them to stand still for 3 to 5 s "
    "with both feet side by side, before or after walking."
)


@dataclass(frozen=True)
class CalibrationParams:
    """Parameters of the calibration stage.

    Parameters
    ----------
    method : how the anterior axis of leg segments is estimated; the trunk always uses the walking direction
    or the declared placement, because the trunk has no sagittal rotation axis in walking
        (docs/science/calibration.md, "Flexion axis by gyro PCA").
    from_walking : calibration without quiet standing. functional : leg swings and trunk bows for calibration.
    forward, joint_turns : joint estimation of forward axes. score : limits of the checks.
    """

    method: Method = "walking_direction"
    rest: RestParams = field(default_factory=RestParams)
    walking: WalkingParams = field(default_factory=WalkingParams)
    heading: HeadingParams = field(default_factory=HeadingParams)
    attitude: AttitudeParams = field(default_factory=AttitudeParams)
    from_walking: WalkRungParams = field(default_factory=WalkRungParams)
    functional: FunctionalParams = field(default_factory=FunctionalParams)
    forward: ForwardParams = field(default_factory=ForwardParams)
    joint_turns: JointTurnParams = field(default_factory=JointTurnParams)
    score: ScoreParams = field(default_factory=ScoreParams)


def calibrate(recording: UniformRecording, params: CalibrationParams | None = None) -> CalibratedRecording:
    """Estimate the sensor-to-segment alignment from quiet standing and walking, without a magnetometer.

    Without quiet standing with the feet side by side the walk alone is used
    (core/calibration/from_walking.py): a pause in mid-stride cannot define the zero of angles.

    Parameters
    ----------
    recording : any subset of segments, with or without a rest before or after the walk.

    Returns
    -------
    CalibratedRecording. A sensor whose direction cannot be determined is omitted with a notice such as
    `pelvis_heading_unknown`; its angles are suppressed, the others remain available.

    Raises
    ------
    SignalError `unit_suspect`; `no_rest`, `rest_too_short`, `not_still`, `no_standing` if there is no
    sufficiently long walk either. CalibrationError `no_segment`; if no sensor can be calibrated, the error of
    the first: `no_walking`, `not_single_axis`, `calibration_sign_conflict`, `pelvis_heading_unknown`.

    References
    ----------
    docs/science/calibration.md; Nazarahari 2021, ch. 3 (gyro PCA).
    """
    params = params or CalibrationParams()
    if not recording.sensors:
        raise CalibrationError("no_segment", "No sensor is assigned to a segment; assign at least one foot.")
    try:
        rests = find_rests(recording, params.rest)
    except SignalError as why:
        return _from_walking(recording, (), params, why)
    movements = find_functional_movements(recording, params.functional)
    moving = moving_mask(recording, params.walking) & ~movements.anywhere
    left = drop_pauses(rests, moving, recording.rate_hz)
    while left:
        zero = choose_rest(left, moving, recording.rate_hz)
        calibrated, ahead = _calibrate_at(recording, rests, zero, moving, params, movements)
        if ahead < LEG_AHEAD:
            return calibrated
        left = tuple(r for r in left if not (r[0] <= zero[0] and zero[1] <= r[1]))
    paused = SignalError("no_standing", NO_STANDING, t_s=rests[0][0])
    return _from_walking(recording, rests, params, paused)


def _from_walking(
    recording: UniformRecording, rests: tuple[Window, ...], params: CalibrationParams, reason: SignalError
) -> CalibratedRecording:
    """Calibrate without standing; `rests` are pauses in walking, rejected for `reason`."""
    return calibrate_from_walking(
        recording,
        params.walking,
        params.heading,
        params.attitude,
        params.from_walking,
        params.method,
        reason,
        rests,
        params.forward,
        params.joint_turns,
    )


def _calibrate_at(
    recording: UniformRecording,
    rests: tuple[Window, ...],
    zero: Window,
    moving: Bools,
    params: CalibrationParams,
    movements: FunctionalMovements,
) -> tuple[CalibratedRecording, float]:
    """Calibrate on one of the rests; also returns how far one leg was ahead of the other in it, rad."""
    rate = recording.rate_hz
    standing = stand_all(recording, zero, rests, params.rest)
    q = {s: _rest_world(recording, s, standing[s], zero, params.attitude) for s in recording.sensors}
    biases = {s: x.gyro_bias for s, x in standing.items()}
    turning = turning_mask(recording, biases, q, params.walking) & moving
    parts = straight_parts(moving, turning, rate, params.walking)
    walk, facing = _walk(recording, rests, zero, parts, q, params.heading)
    axes: dict[Segment, AnteriorAxis] = {}
    failed: list[CalibrationError] = []
    for s, signals in recording.sensors.items():
        declared = recording.mounting.get(s, "")
        try:
            axes[s] = find_anterior_axis(
                s, signals, standing[s], q[s], walk, declared, params.method, params.heading, params.forward
            )
        except CalibrationError as error:
            failed.append(error)
    axes |= find_functional_axes(recording, movements, standing, q, params.functional, params.forward)
    failed = [error for error in failed if error.sensor not in axes]
    if not axes and failed:
        raise failed[0]
    orientations = {s: q[s] for s in axes}
    joints = measure_joint_turns(recording, biases, orientations, walk.parts, params.joint_turns)
    axes = weigh_axes(axes, joints, params.forward)
    notices = [Notice(error.code, error.message, sensor=error.sensor) for error in failed]
    for f in axes.values():
        notices += f.notices
    steps = _straight_steps(axes, standing, q, walk)
    if steps is not None and steps < FEW_STEPS:
        message = Message(
            f"Calibration used about {{steps}} straight {plural(steps, 'step', 'steps')}; {{FEW_STEPS}} "
            "or more are recommended. Walk further straight ahead.",
            steps=steps,
            FEW_STEPS=FEW_STEPS,
        )
        notices.append(Notice("few_steps", message))
    if facing:
        notices.append(_tell_facing(facing, walk.leads))
    calibration = Calibration(
        segments={s: _mounted(standing[s], f) for s, f in axes.items()},
        rest=rests,
        walking=tuple((a / rate, b / rate) for a, b in parts),
        zero=zero,
        turning=turning,
        method=params.method,
        notices=tuple(notices),
        diagnostics={s: {"method": f.method, "score": f.score, **f.facts} for s, f in axes.items()},
        straight_steps=steps,
    )
    ahead = measure_leg_ahead(_tilts(axes, standing, q, parts, params.from_walking.least_s * rate))
    return CalibratedRecording(recording, calibration), ahead


def _rest_world(
    recording: UniformRecording,
    segment: Segment,
    standing: SensorAtRest,
    zero: Window,
    params: AttitudeParams,
) -> Floats:
    """Orientations (n, 4) of a sensor in its rest frame: z up, x along the x axis of its vertical frame at
    rest.
    """
    signals = recording.sensors[segment]
    middle = round(0.5 * (zero[0] + zero[1]) * recording.rate_hz)
    q_rest = from_matrix(R_NEUTRAL @ vertical_frame(standing.up))
    gyr, acc = HeldSeries(signals, "gyr", standing.gyro_bias), HeldSeries(signals, "acc")
    return estimate_orientation(
        q_rest, middle, gyr, acc, signals.valid, recording.rate_hz, standing.rest_norm, params
    )


def _walk(
    recording: UniformRecording,
    rests: tuple[Window, ...],
    zero: Window,
    parts: list[Part],
    q: Mapping[Segment, Floats],
    params: HeadingParams,
) -> tuple[CalibrationWalk, float]:
    """The straight parts used for the walking direction, and their turn relative to the standing
    direction.
    """
    rate = recording.rate_hz
    whole_rest = next(r for r in rests if r[0] <= zero[0] and zero[1] <= r[1])
    first, last = round(whole_rest[0] * rate), round(whole_rest[1] * rate)
    reach = round(params.reach_s * rate)
    following = [p for p in parts if p[0] >= last - rate and p[0] <= last + reach]
    leads = bool(following)
    near = following or [p for p in reversed(parts) if p[1] <= first + rate and p[1] >= first - reach]
    mid = round(0.5 * (zero[0] + zero[1]) * rate)
    show = turn_sensors(recording)
    turns = [
        float(np.angle(np.mean([np.exp(1j * mean_turn(q[s], q[s][mid], p)) for s in show]))) for p in near
    ]
    facing = turns[0] if turns and abs(turns[0]) > FACING else 0.0
    bearing = [t - (0.0 if facing else turns[0]) for t in turns]
    other_rests = [r for r in rests if (r[0] > whole_rest[1] if leads else r[1] < whole_rest[0])]
    span = None
    if other_rests and near:
        span = (last, round(other_rests[0][0] * rate)) if leads else (round(other_rests[-1][1] * rate), first)
        if span[1] - span[0] > params.longest_velocity_s * rate:
            span = None
    mask = np.zeros(len(recording.t_s), bool)
    for a, b in near:
        mask[a:b] = True
    trunk = next((s for s in TRUNK if s in q), None)
    steps_s = None
    if trunk is not None:
        up = rotate(q[trunk], recording.sensors[trunk].acc)[:, 2]
        steps_s = [step_time(up[a:b], rate) for a, b in near]
    return CalibrationWalk(whole_rest, leads, near, bearing, span, mask, steps_s, rate), facing


def _tell_facing(turn: float, leads: bool) -> Notice:
    """Notice that standing and walking directions differ, rad; `leads`: standing precedes the walk."""
    order, todo = (
        ("standing and walking", "Start straight ahead from standing where possible.")
        if leads
        else ("walking and standing", "Stand still where the walk ends before turning where possible.")
    )
    message = Message(
        "The person turned by {abs:.0f}° between {between}; forward is where they stood facing. {todo}",
        abs=abs(degrees(turn)),
        between=order,
        todo=todo,
    )
    return Notice("facing_not_walking", message, severity="info")


def _mounted(standing: SensorAtRest, found: AnteriorAxis) -> SegmentCalibration:
    return SegmentCalibration(
        R_segment_sensor=about_vertical(-found.angle) @ vertical_frame(standing.up),
        gyro_bias=standing.gyro_bias,
        rest_norm=standing.rest_norm,
        method=found.method,
        score=min(1.0, max(0.0, found.score)),
        forward_sd=found.sd,
    )


def _tilts(
    axes: Mapping[Segment, AnteriorAxis],
    standing: Mapping[Segment, SensorAtRest],
    q: Mapping[Segment, Floats],
    parts: list[Part],
    least: float,
) -> dict[Segment, float]:
    """Mean sagittal inclination of each segment in straight walking, rad; empty below `least` samples."""
    if sum(b - a for a, b in parts) < least:
        return {}
    tilts = {}
    for s, f in axes.items():
        up = [find_vertical(q[s][a:b]) for a, b in parts]
        mean = np.concatenate(up).mean(axis=0)[None]
        R = about_vertical(-f.angle) @ vertical_frame(standing[s].up)
        tilts[s] = float(sagittal_angle(mean, R)[0])
    return tilts


def _straight_steps(
    found: Mapping[Segment, AnteriorAxis],
    standing: Mapping[Segment, SensorAtRest],
    q: Mapping[Segment, Floats],
    walk: CalibrationWalk,
) -> int | None:
    """Number of steps used for the direction: twice the swings of one leg sensor."""
    leg = next((s for s in found if s not in TRUNK), None)
    if leg is None or not walk.parts:
        return None
    R = about_vertical(-found[leg].angle) @ vertical_frame(standing[leg].up)
    return count_steps(sagittal_course(q[leg], R), walk.mask)
