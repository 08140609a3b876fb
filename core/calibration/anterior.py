"""Anterior axis of one sensor, from whatever evidence the recording provides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, radians
from typing import Literal

import numpy as np

from sagittal.core.calibration.forward import (
    ForwardMeasure,
    ForwardParams,
    JointMeasure,
    weigh_forward_axes,
)
from sagittal.core.calibration.gyro_pca import (
    GOOD_AXIS,
    SINGLE_AXIS,
    WEAK_MARGIN,
    FlexionAxis,
    about_vertical,
    flexion_axis,
    gait_margin,
    measure_flexion,
    sagittal_course,
)
from sagittal.core.calibration.heading import (
    Complexes,
    HeadingParams,
    WalkingDirection,
    acceleration_axis,
    horizontal_acceleration,
    nearest_sign,
    pendulum_agreement,
    subtract_angles,
)
from sagittal.core.calibration.mounting import read_declared_angle
from sagittal.core.calibration.standing import SensorAtRest, vertical_frame
from sagittal.core.calibration.walking import TRUNK
from sagittal.core.calibration.ways import (
    DISAGREEMENT,
    CalibrationWalk,
    choose_way,
    list_ways,
    measure_ways,
    tell_disagreement,
)
from sagittal.core.errors import CalibrationError, Notice
from sagittal.core.frames import Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import rotate
from sagittal.core.signals.recording import SensorSignals

CONFLICT = radians(120.0)
"""Difference from the declared mounting that is a contradiction: within 60° of the opposite way."""

CLEAR_MARGIN = radians(15.0)
"""Gait-rule margin that contradicts a measured direction: right signs had 18 to 40° on neura_walk
(docs/science/calibration.md, "Signs"), while a simulated thigh shows 8° the other way."""

Method = Literal["walking_direction", "gyro_pca"]


@dataclass(frozen=True, eq=False)
class AnteriorAxis:
    """Anterior axis of one sensor: first by rule, then refined jointly over all sensors.

    Parameters
    ----------
    angle : in the sensor's rest frame, rad. notices : to report. measures : all evidence for it.
    mirror : its flexion axis, for comparison with the mirrored one of the other side; None if unclear.
    kept : the angle found by rule is final, regardless of the other sensors. sd : of the angle, rad.
    """

    angle: float
    method: str
    score: float
    notices: tuple[Notice, ...] = ()
    facts: Mapping[str, object] = field(default_factory=dict)
    measures: tuple[ForwardMeasure, ...] = ()
    mirror: ForwardMeasure | None = None
    kept: bool = False
    sd: float | None = None


def find_anterior_axis(
    segment: Segment,
    signals: SensorSignals,
    standing: SensorAtRest,
    q: Floats,
    walk: CalibrationWalk,
    declared: str,
    method: Method,
    params: HeadingParams,
    forward: ForwardParams,
) -> AnteriorAxis:
    """Estimate the anterior axis of one segment on its own, and collect all evidence for it.

    Parameters
    ----------
    q : (n, 4) sensor to its rest frame. declared : placement text, "" if not declared.

    Raises
    ------
    CalibrationError `no_walking`, `pelvis_heading_unknown`, `not_single_axis`, `calibration_sign_conflict`.
    """
    R_vertical = vertical_frame(standing.up)
    written = read_declared_angle(declared, R_vertical, segment)
    if not walk.parts:
        if written is None:
            raise CalibrationError(
                "no_walking",
                Message(
                    "{segment}: no straight walking of at least 1.5 s detected and no placement "
                    "declared. Record "
                    "at least 8 steps straight ahead, or declare the placement: “lateral, face right”.",
                    segment=segment,
                ),
                sensor=segment,
            )
        measure = ForwardMeasure("declared", written, forward.declared_sd, forward.declared_doubt)
        return AnteriorAxis(written, "declared", 0.5, measures=(measure,), kept=True)
    if method == "gyro_pca" and segment not in TRUNK:
        axis = _by_gyro(segment, signals, standing, R_vertical, q, walk, written, forward)
    else:
        axis = _by_walking(segment, signals, standing, R_vertical, q, walk, written, params, forward)
    if written is not None and abs(subtract_angles(axis.angle, written)) > CONFLICT:
        raise CalibrationError(
            "calibration_sign_conflict",
            Message(
                "{segment}: the walk and the declared placement “{declared}” differ by {abs:.0f}° (allowed: "
                "{CONFLICT:.0f}°). Correct the placement in the manifest, or the segment assigned to this "
                "sensor.",
                segment=segment,
                declared=declared,
                abs=abs(degrees(subtract_angles(axis.angle, written))),
                CONFLICT=degrees(CONFLICT),
            ),
            sensor=segment,
        )
    return axis


def _by_walking(
    segment: Segment,
    signals: SensorSignals,
    standing: SensorAtRest,
    R_vertical: Floats,
    q: Floats,
    walk: CalibrationWalk,
    written: float | None,
    params: HeadingParams,
    forward: ForwardParams,
) -> AnteriorAxis:
    """Direction of the rest-to-rest velocity, or the axis of the acceleration with its sign from other
    evidence.
    """
    pca = measure_flexion(signals.gyr[walk.mask] - standing.gyro_bias, R_vertical)
    a = horizontal_acceleration(q, signals.acc)
    steps_s = walk.steps_s if segment in TRUNK else None
    axis = acceleration_axis(a, walk.parts, walk.bearing, walk.rate_hz, params, steps_s)
    ways = measure_ways(segment, signals, standing, a, walk, params)
    facts: dict[str, object] = {"axis_share": axis.score}
    way = choose_way(ways, axis)
    if way is None:
        angle, notices, signed = _sign_axis(
            segment, signals, R_vertical, q, a, axis.angle, walk, written, params
        )
        heard, mirror = list_axis_measures(segment, angle, axis, pca, forward)
        return AnteriorAxis(
            angle, "walking_direction", axis.score, notices, facts | signed, measures=heard, mirror=mirror
        )
    chosen = way.chosen
    facts |= way.facts
    agrees = _vaulting(segment, signals, q, a, chosen.angle, walk)
    if abs(agrees) >= params.pendulum:
        facts["pendulum"] = agrees
    if agrees <= -params.pendulum:
        # a velocity gained since a standing that swayed can point backwards, a walking trunk cannot
        facts |= {"source": "acceleration", "sign": "pendulum"}
        chosen = WalkingDirection(nearest_sign(axis.angle, chosen.angle + np.pi), axis.score)
        ways = replace(ways, velocity=None, start=None)
    notices = _sign_notices(segment, chosen.angle, R_vertical, q, walk)
    heard, mirror = list_axis_measures(segment, chosen.angle, axis, pca, forward)
    if ways.strides is not None and abs(way.off) > DISAGREEMENT:
        notices += (tell_disagreement(segment, way.off),)
    return AnteriorAxis(
        chosen.angle,
        "walking_direction",
        chosen.score,
        notices,
        facts,
        measures=list_ways(ways, heard, forward),
        mirror=mirror,
        kept=ways.strides is not None,
    )


def _sign_axis(
    segment: Segment,
    signals: SensorSignals,
    R_vertical: Floats,
    q: Floats,
    a: Complexes,
    axis: float,
    walk: CalibrationWalk,
    written: float | None,
    params: HeadingParams,
) -> tuple[float, tuple[Notice, ...], dict[str, object]]:
    """Forward end of the acceleration axis if no velocity determines it, with the evidence used."""
    agrees = _vaulting(segment, signals, q, a, axis, walk)
    if written is None and abs(agrees) >= params.pendulum:
        angle = nearest_sign(axis, axis + (0.0 if agrees > 0.0 else np.pi))
        return angle, (), {"source": "acceleration", "sign": "pendulum", "pendulum": agrees}
    angle, notices = _signed(segment, axis, written, R_vertical, q, walk)
    return angle, notices, {"source": "acceleration", "sign": "gait" if written is None else "declared"}


def list_axis_measures(
    segment: Segment, angle: float, axis: WalkingDirection, pca: FlexionAxis, params: ForwardParams
) -> tuple[tuple[ForwardMeasure, ...], ForwardMeasure | None]:
    """Forward-axis measures from the axes of acceleration and rotation, and the one for use by the other
    side.

    Parameters
    ----------
    angle : approximate forward axis that determines the signs of both axes, rad.
    """
    doubt = max(params.axis_doubt, 1.0 - axis.score)
    heard = [ForwardMeasure("acceleration", nearest_sign(axis.angle, angle), params.axis_sd, doubt)]
    # walking gives a trunk no sagittal axis of turning
    if segment in TRUNK or pca.rho < SINGLE_AXIS:
        return tuple(heard), None
    flexion = nearest_sign(-pca.gamma, angle)
    heard.append(ForwardMeasure("gyro_pca", flexion, params.pca_sd, params.pca_doubt))
    clear = pca.rho >= GOOD_AXIS
    return tuple(heard), (
        ForwardMeasure("mirror", flexion, params.mirror_sd, params.pca_doubt) if clear else None
    )


def weigh_axes(
    axes: Mapping[Segment, AnteriorAxis], joints: Sequence[JointMeasure], params: ForwardParams
) -> dict[Segment, AnteriorAxis]:
    """Estimate the forward axes of all sensors jointly, with their uncertainty and a notice if it is
    large.
    """
    mirrors = {s: f.mirror for s, f in axes.items() if f.mirror is not None}
    weighed = weigh_forward_axes({s: f.measures for s, f in axes.items()}, joints, mirrors)
    better = {}
    for s, f in axes.items():
        w = weighed[s]
        angle = f.angle if f.kept else w.angle
        votes = [
            {"source": v.source, "off_rad": subtract_angles(v.angle, angle), "share": v.share}
            for v in w.votes
        ]
        uncertain = (_tell_uncertain(s, w.sd, params.tell_sd),) if w.sd > params.tell_sd else ()
        better[s] = replace(
            f, angle=angle, sd=w.sd, notices=f.notices + uncertain, facts={**f.facts, "votes": votes}
        )
    return better


def _tell_uncertain(segment: Segment, sd: float, limit: float) -> Notice:
    return Notice(
        "forward_uncertain",
        Message(
            "{segment}: the forward direction is known only to ± {sd:.0f}° (good: ± {limit:.0f}°). "
            "Frontal and transverse angles are unreliable there. Start walking straight ahead from "
            "standing and walk further.",
            segment=segment,
            sd=degrees(sd),
            limit=degrees(limit),
        ),
        sensor=segment,
    )


def _vaulting(
    segment: Segment, signals: SensorSignals, q: Floats, a: Complexes, angle: float, walk: CalibrationWalk
) -> float:
    """`pendulum_agreement` of a pelvis with a direction; 0 for other segments."""
    if segment != "pelvis" or walk.steps_s is None:
        return 0.0
    up = rotate(q, signals.acc)[:, 2]
    return pendulum_agreement(a, up, angle, walk.parts, walk.bearing, walk.rate_hz, walk.steps_s)


def _by_gyro(
    segment: Segment,
    signals: SensorSignals,
    standing: SensorAtRest,
    R_vertical: Floats,
    q: Floats,
    walk: CalibrationWalk,
    written: float | None,
    forward: ForwardParams,
) -> AnteriorAxis:
    """Flexion axis by gyro PCA, sign from the declared placement or the gait rules."""
    axis = flexion_axis(signals.gyr[walk.mask] - standing.gyro_bias, R_vertical, segment)
    angle, notices = _signed(segment, -axis.gamma, written, R_vertical, q, walk)
    if axis.rho < GOOD_AXIS:
        notices += (
            Notice(
                "not_single_axis",
                Message(
                    "{segment}: the first principal component explains {rho:.0%} of the movement (good: "
                    "{GOOD_AXIS:.0%} or more); the flexion axis may be off by 10° or more.",
                    segment=segment,
                    rho=axis.rho,
                    GOOD_AXIS=GOOD_AXIS,
                ),
                sensor=segment,
            ),
        )
    measure = ForwardMeasure("gyro_pca", angle, forward.pca_sd, forward.pca_doubt)
    return AnteriorAxis(
        angle, "gyro_pca", axis.rho, notices, {"rho": axis.rho}, measures=(measure,), kept=True
    )


def _signed(
    segment: Segment, axis: float, written: float | None, R_vertical: Floats, q: Floats, walk: CalibrationWalk
) -> tuple[float, tuple[Notice, ...]]:
    """Choose the sign of an axis: from the declared placement first, then by the gait rules
    (docs/science/calibration.md, "Signs").
    """
    if written is not None:
        angle = nearest_sign(axis, written)
        return angle, _sign_notices(segment, angle, R_vertical, q, walk)
    if segment in TRUNK:
        raise CalibrationError(
            "pelvis_heading_unknown",
            Message(
                "{segment}: its facing direction is unknown because there is no quiet standing next to the "
                "walk. Stand still for 3 s directly before walking, or declare the placement, for example "
                "“sacrum, face backwards”.",
                segment=segment,
            ),
            sensor=segment,
        )
    margin = _margin(segment, axis, R_vertical, q, walk)
    if abs(margin) < WEAK_MARGIN:
        weak = Notice(
            "calibration_sign_weak",
            Message(
                "{segment}: forward and backward swing differ by only {degrees:.1f}°; at least "
                "{WEAK_MARGIN:.0f}° are needed to determine the forward direction. Check the sign of the "
                "curves, or declare the placement.",
                segment=segment,
                degrees=degrees(abs(margin)),
                WEAK_MARGIN=degrees(WEAK_MARGIN),
            ),
            sensor=segment,
        )
        return (axis if margin >= 0 else nearest_sign(axis, axis + np.pi)), (weak,)
    return (axis if margin > 0 else nearest_sign(axis, axis + np.pi)), ()


def _margin(segment: Segment, angle: float, R_vertical: Floats, q: Floats, walk: CalibrationWalk) -> float:
    return gait_margin(sagittal_course(q, about_vertical(-angle) @ R_vertical), walk.mask, segment)


def _sign_notices(
    segment: Segment, angle: float, R_vertical: Floats, q: Floats, walk: CalibrationWalk
) -> tuple[Notice, ...]:
    """Notice if the gait rule contradicts a sign from other evidence; velocity and declaration take
    precedence.
    """
    if segment in TRUNK:
        return ()
    margin = _margin(segment, angle, R_vertical, q, walk)
    if margin > -CLEAR_MARGIN:
        return ()
    return (
        Notice(
            "calibration_sign_conflict",
            Message(
                "{segment}: it swings {degrees:.0f}° further in the direction in which it should swing less. "
                "Check that it is assigned to the right segment and that the person walked forwards.",
                segment=segment,
                degrees=degrees(-margin),
            ),
            sensor=segment,
        ),
    )
