"""The calibration stage: rest → vertical and bias, walking → anterior axis of every segment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees, radians

import numpy as np

from core.calibration.anterior import AnteriorAxis, CalibrationWalk, Method, find_anterior_axis
from core.calibration.from_walking import calibrate_from_walking
from core.calibration.gyro_pca import about_vertical, count_steps, sagittal_angle
from core.calibration.heading import HeadingParams, Part, step_time
from core.calibration.result import CalibratedRecording, Calibration, SegmentCalibration
from core.calibration.sensor_in_walk import WalkRungParams
from core.calibration.standing import SensorAtRest, choose_rest, find_rests, stand_all, vertical_frame
from core.calibration.walking import (
    TRUNK,
    WalkingParams,
    mean_turn,
    moving_mask,
    straight_parts,
    turn_sensors,
    turning_mask,
)
from core.errors import CalibrationError, Notice, SignalError
from core.frames import R_NEUTRAL, Floats, Segment
from core.fusion.attitude import AttitudeParams, estimate_orientation
from core.recording import UniformRecording
from core.rest import RestParams, Window
from core.rotation import conjugate, from_matrix, rotate

FACING = radians(20.0)
"""Turn between standing and the first straight part that still counts as facing the walk (our choice)."""

FEW_STEPS = 8
"""Steps below which calibration says how few there were (docs/science/calibration.md, "Parameters")."""


@dataclass(frozen=True)
class CalibrationParams:
    """Parameters of the calibration stage.

    Parameters
    ----------
    method : how the anterior axis of leg segments is found; the trunk is always by walking direction or
        declared mounting, because walking gives it no sagittal axis
        (docs/science/calibration.md, "Flexion axis by gyro PCA").
    from_walking : where nobody stands still.
    """

    method: Method = "walking_direction"
    rest: RestParams = field(default_factory=RestParams)
    walking: WalkingParams = field(default_factory=WalkingParams)
    heading: HeadingParams = field(default_factory=HeadingParams)
    attitude: AttitudeParams = field(default_factory=AttitudeParams)
    from_walking: WalkRungParams = field(default_factory=WalkRungParams)


def calibrate(recording: UniformRecording, params: CalibrationParams | None = None) -> CalibratedRecording:
    """Find how each sensor sits on its segment, from standing and walking, without a magnetometer.

    Where nobody stands still the walk alone has to do (core/calibration/from_walking.py).

    Parameters
    ----------
    recording : any subset of segments; rest before or after the walk, or none.

    Returns
    -------
    CalibratedRecording. A sensor whose direction cannot be found is left out with a notice, as
    `pelvis_heading_unknown`, so that its angles are withheld and the others still work.

    Raises
    ------
    SignalError `unit_suspect`; `no_rest`, `rest_too_short`, `not_still` where there is no walk either.
    CalibrationError `no_segment`; where no sensor can be calibrated that of the first: `no_walking`,
    `not_single_axis`, `calibration_sign_conflict`, `pelvis_heading_unknown`.

    References
    ----------
    docs/science/calibration.md; Nazarahari 2021, ch. 3 (gyro PCA).
    """
    params = params or CalibrationParams()
    if not recording.sensors:
        raise CalibrationError("no_segment", "No sensor is mapped to a segment; map at least one foot.")
    rate = recording.rate_hz
    try:
        rests = find_rests(recording, params.rest)
    except SignalError as why:
        return calibrate_from_walking(
            recording,
            params.walking,
            params.heading,
            params.attitude,
            params.from_walking,
            params.method,
            why,
        )
    moving = moving_mask(recording, params.walking)
    zero = choose_rest(rests, moving, rate)
    standing = stand_all(recording, zero, rests, params.rest)
    q = {s: _rest_world(recording, s, standing[s], zero, params.attitude) for s in recording.sensors}
    biases = {s: x.gyro_bias for s, x in standing.items()}
    turning = turning_mask(recording, biases, q, params.walking) & moving
    parts = straight_parts(moving, turning, rate, params.walking)
    walk, facing = _walk(recording, rests, zero, parts, q, params.heading)
    found: dict[Segment, AnteriorAxis] = {}
    notices: list[Notice] = []
    failed: CalibrationError | None = None
    for s, signals in recording.sensors.items():
        declared = recording.mounting.get(s, "")
        try:
            found[s] = find_anterior_axis(
                s, signals, standing[s], q[s], walk, declared, params.method, params.heading
            )
        except CalibrationError as error:
            failed = failed or error
            notices.append(Notice(error.code, error.message, sensor=s))
    if not found and failed is not None:
        raise failed
    for f in found.values():
        notices += f.notices
    steps = _straight_steps(found, standing, q, walk)
    if steps is not None and steps < FEW_STEPS:
        message = (
            f"Calibration saw about {steps} straight steps, {FEW_STEPS} or more are good; walk further "
            "straight."
        )
        notices.append(Notice("few_steps", message))
    if facing:
        notices.append(
            Notice(
                "facing_not_walking",
                f"The person turned by {abs(degrees(facing)):.0f}° between standing and walking; forward is "
                "where they stood facing. Start straight ahead from standing where possible.",
                severity="info",
            )
        )
    calibration = Calibration(
        segments={s: _mounted(standing[s], f) for s, f in found.items()},
        rest=rests,
        walking=tuple((a / rate, b / rate) for a, b in parts),
        zero=zero,
        turning=turning,
        method=params.method,
        notices=tuple(notices),
        diagnostics={s: {"method": f.method, "score": f.score, **f.facts} for s, f in found.items()},
        straight_steps=steps,
    )
    return CalibratedRecording(recording, calibration)


def _rest_world(
    recording: UniformRecording,
    segment: Segment,
    standing: SensorAtRest,
    zero: Window,
    params: AttitudeParams,
) -> Floats:
    """Orientations (n, 4) of a sensor in its rest world: z up, x along its vertical frame's x at rest."""
    signals = recording.sensors[segment]
    at = round(0.5 * (zero[0] + zero[1]) * recording.rate_hz)
    q_rest = from_matrix(R_NEUTRAL @ vertical_frame(standing.up))
    gyr = signals.gyr - standing.gyro_bias
    return estimate_orientation(
        q_rest, at, gyr, signals.acc, signals.valid, recording.rate_hz, standing.rest_norm, params
    )


def _walk(
    recording: UniformRecording,
    rests: tuple[Window, ...],
    zero: Window,
    parts: list[Part],
    q: Mapping[Segment, Floats],
    params: HeadingParams,
) -> tuple[CalibrationWalk, float]:
    """The straight parts to take the direction from, and their turn from where the person stood facing."""
    rate = recording.rate_hz
    rest = next(r for r in rests if r[0] <= zero[0] and zero[1] <= r[1])
    first, last = round(rest[0] * rate), round(rest[1] * rate)
    reach = round(params.reach_s * rate)
    after = [p for p in parts if p[0] >= last - rate and p[0] <= last + reach]
    leads = bool(after)
    near = after or [p for p in reversed(parts) if p[1] <= first + rate and p[1] >= first - reach]
    mid = round(0.5 * (zero[0] + zero[1]) * rate)
    show = turn_sensors(recording)
    turns = [
        float(np.angle(np.mean([np.exp(1j * mean_turn(q[s], q[s][mid], p)) for s in show]))) for p in near
    ]
    facing = turns[0] if turns and abs(turns[0]) > FACING else 0.0
    bearing = [t - (0.0 if facing else turns[0]) for t in turns]
    other = [r for r in rests if (r[0] > rest[1] if leads else r[1] < rest[0])]
    span = None
    if other and near:
        span = (last, round(other[0][0] * rate)) if leads else (round(other[-1][1] * rate), first)
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
    return CalibrationWalk(rest, leads, near, bearing, span, mask, steps_s, rate), facing


def _mounted(standing: SensorAtRest, found: AnteriorAxis) -> SegmentCalibration:
    return SegmentCalibration(
        R_segment_sensor=about_vertical(-found.angle) @ vertical_frame(standing.up),
        gyro_bias=standing.gyro_bias,
        rest_norm=standing.rest_norm,
        method=found.method,
        score=min(1.0, max(0.0, found.score)),
    )


def _straight_steps(
    found: Mapping[Segment, AnteriorAxis],
    standing: Mapping[Segment, SensorAtRest],
    q: Mapping[Segment, Floats],
    walk: CalibrationWalk,
) -> int | None:
    """Steps that the direction rests on: twice the swings of one leg sensor."""
    leg = next((s for s in found if s not in TRUNK), None)
    if leg is None or not walk.parts:
        return None
    up = rotate(conjugate(q[leg]), np.array([0.0, 0.0, 1.0]))
    R = about_vertical(-found[leg].angle) @ vertical_frame(standing[leg].up)
    return count_steps(sagittal_angle(up, R), walk.mask)
