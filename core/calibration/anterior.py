"""Where is forward in a sensor: the anterior axis of one segment, from whatever the take offers for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, hypot, radians
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
    Part,
    WalkingDirection,
    acceleration_axis,
    horizontal_acceleration,
    nearest_sign,
    pendulum_agreement,
    rest_to_rest_velocity,
    start_direction,
    stride_direction,
    subtract_angles,
    velocity_direction,
)
from sagittal.core.calibration.mounting import read_declared_angle
from sagittal.core.calibration.sensor_in_walk import WalkRungParams, find_flat_moments
from sagittal.core.calibration.standing import SensorAtRest, vertical_frame
from sagittal.core.calibration.walking import TRUNK
from sagittal.core.errors import CalibrationError, Notice
from sagittal.core.frames import FOOT, Bools, Floats, Segment
from sagittal.core.rotation import rotate
from sagittal.core.signals.recording import SensorSignals
from sagittal.core.signals.rest import Window

DISAGREEMENT = radians(15.0)
"""Difference of two measures of the walking direction that is told
(docs/science/real-recordings.md, "Heading")."""

COARSE = radians(30.0)
"""The same where velocity comes from one rest only: a tilt of 1° and 3 s make 0.5 m/s across (our choice)."""

CONFLICT = radians(120.0)
"""Difference from the declared mounting that is a contradiction: within 60° of the opposite way."""

STRONG_AXIS = 0.6
"""Share of the acceleration axis from which it goes before a velocity that disagrees with it. Fitted to
nothing: the shares were .73 to .97 on neura_walk and gaitmap_foot, .22 where the axis of a simulated pelvis
was wrong."""

CLEAR_MARGIN = radians(15.0)
"""Gait-rule margin that contradicts a measured direction: right signs had 18 to 40° on neura_walk
(docs/science/calibration.md, "Signs"), while a simulated thigh shows 8° the other way."""

Method = Literal["walking_direction", "gyro_pca"]


@dataclass(frozen=True, eq=False)
class CalibrationWalk:
    """The straight walking that shows the direction, as seen from the rest that calibration uses.

    Parameters
    ----------
    rest : the whole rest window. leads : it comes before the walk. parts : straight parts, the nearest first.
    bearing : turn of each part since standing, rad. span : index range between two rests, None if there is no
    second rest near enough. mask : (n,) samples of the parts. steps_s : step time in each part,
    None without a trunk sensor.
    """

    rest: Window
    leads: bool
    parts: list[Part]
    bearing: list[float]
    span: Part | None
    mask: Bools
    steps_s: list[float] | None
    rate_hz: float


@dataclass(frozen=True, eq=False)
class AnteriorAxis:
    """The anterior axis of one sensor: first by rule, then as all sensors together have it.

    Parameters
    ----------
    angle : in the sensor's rest world, rad. notices : what to tell. measures : all that speaks of it.
    mirror : the axis it turns about, as the other side's would be mirrored; None where that is not clear.
    kept : the rule's angle stands, whatever the others say. sd : of the angle, rad.
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
    """Find the anterior axis of one segment by itself, and all that speaks of it.

    Parameters
    ----------
    q : (n, 4) sensor to its rest world. declared : mounting text, "" if nobody said.

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
                f"{segment}: no straight walking of 1.5 s or more was found and no mounting is declared. "
                "Record at least 8 steps straight ahead, or declare the mounting: “lateral, face right”.",
                sensor=segment,
            )
        said = ForwardMeasure("declared", written, forward.declared_sd, forward.declared_doubt)
        return AnteriorAxis(written, "declared", 0.5, measures=(said,), kept=True)
    if method == "gyro_pca" and segment not in TRUNK:
        found = _by_gyro(segment, signals, standing, R_vertical, q, walk, written, forward)
    else:
        found = _by_walking(segment, signals, standing, R_vertical, q, walk, written, params, forward)
    if written is not None and abs(subtract_angles(found.angle, written)) > CONFLICT:
        raise CalibrationError(
            "calibration_sign_conflict",
            f"{segment}: the walk and the declared mounting “{declared}” differ by "
            f"{abs(degrees(subtract_angles(found.angle, written))):.0f}°, "
            f"allowed are {degrees(CONFLICT):.0f}°. "
            "Correct the mounting in the manifest, or the segment this sensor is mapped to.",
            sensor=segment,
        )
    return found


def _by_strides(
    segment: Segment,
    signals: SensorSignals,
    standing: SensorAtRest,
    a: Complexes,
    walk: CalibrationWalk,
    params: HeadingParams,
) -> WalkingDirection | None:
    """Direction of a foot's strides, each from one flat moment to the next; None for other segments."""
    if segment not in FOOT.values():
        return None
    flats = find_flat_moments(
        signals.gyr - standing.gyro_bias, walk.mask & signals.valid, walk.rate_hz, WalkRungParams()
    )
    return stride_direction(a, flats, walk.parts, walk.bearing, walk.rate_hz, params)


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
    """Direction of the rest-to-rest velocity, or the axis of the acceleration with a sign from elsewhere."""
    pca = measure_flexion(signals.gyr[walk.mask] - standing.gyro_bias, R_vertical)
    a = horizontal_acceleration(q, signals.acc)
    steps_s = walk.steps_s if segment in TRUNK else None
    axis = acceleration_axis(a, walk.parts, walk.bearing, walk.rate_hz, params, steps_s)
    velocity = None
    if walk.span is not None:
        first, last = walk.span
        v = rest_to_rest_velocity(a[first:last], True, walk.rate_hz)
        inside = [
            (p, b) for p, b in zip(walk.parts, walk.bearing, strict=True) if first <= p[0] and p[1] <= last
        ]
        velocity = velocity_direction(v, first, [p for p, _ in inside], [b for _, b in inside], params)
    facts: dict[str, object] = {"axis_share": axis.score}
    start = None
    strides = _by_strides(segment, signals, standing, a, walk, params)
    if strides is not None:
        off = subtract_angles(nearest_sign(axis.angle, strides.angle), strides.angle)
        facts |= {"source": "strides", "disagreement_rad": off}
        chosen = strides
    elif velocity is not None:
        off = subtract_angles(nearest_sign(axis.angle, velocity.angle), velocity.angle)
        facts |= {"source": "velocity", "disagreement_rad": off}
        if abs(off) > DISAGREEMENT and axis.score > STRONG_AXIS:
            # one lost impact bends an integrated velocity, many strides hold the axis
            facts["source"] = "acceleration"
            chosen = WalkingDirection(nearest_sign(axis.angle, velocity.angle), axis.score)
        else:
            chosen = velocity
    else:
        gap_s = params.trunk_gap_s if segment in TRUNK else params.leg_gap_s
        start = start_direction(
            a, walk.rest, walk.parts[0], walk.bearing[0], walk.leads, walk.rate_hz, gap_s, params
        )
        if start is None:
            agrees = _vaulting(segment, signals, q, a, axis.angle, walk)
            if written is None and abs(agrees) >= params.pendulum:
                facts |= {"source": "acceleration", "sign": "pendulum", "pendulum": agrees}
                angle = nearest_sign(axis.angle, axis.angle + (0.0 if agrees > 0.0 else np.pi))
                heard, mirror = list_axis_measures(segment, angle, axis, pca, forward)
                return AnteriorAxis(
                    angle, "walking_direction", axis.score, (), facts, measures=heard, mirror=mirror
                )
            angle, notices = _signed(segment, axis.angle, written, R_vertical, q, walk)
            facts |= {"source": "acceleration", "sign": "declared" if written is not None else "gait"}
            heard, mirror = list_axis_measures(segment, angle, axis, pca, forward)
            return AnteriorAxis(
                angle, "walking_direction", axis.score, notices, facts, measures=heard, mirror=mirror
            )
        off = subtract_angles(nearest_sign(axis.angle, start.angle), start.angle)
        facts |= {"source": "acceleration", "sign": "velocity", "disagreement_rad": off}
        chosen = WalkingDirection(nearest_sign(axis.angle, start.angle), axis.score)
        if abs(off) > COARSE and axis.score <= STRONG_AXIS:
            facts["source"] = "velocity"
            chosen = WalkingDirection(start.angle, 0.5)
    agrees = _vaulting(segment, signals, q, a, chosen.angle, walk)
    if abs(agrees) >= params.pendulum:
        facts["pendulum"] = agrees
    if agrees <= -params.pendulum:
        # a velocity gained since a standing that swayed can point backwards, a walking trunk cannot
        facts |= {"source": "acceleration", "sign": "pendulum"}
        chosen = WalkingDirection(nearest_sign(axis.angle, chosen.angle + np.pi), axis.score)
        velocity = start = None
    notices = _sign_notices(segment, chosen.angle, R_vertical, q, walk)
    heard, mirror = list_axis_measures(segment, chosen.angle, axis, pca, forward)
    if strides is not None:
        heard = (ForwardMeasure("strides", strides.angle, forward.strides_sd, forward.strides_doubt),)
        if abs(off) > DISAGREEMENT:
            message = (
                f"{segment}: strides and acceleration show ways {abs(degrees(off)):.0f}° apart, "
                f"{degrees(DISAGREEMENT):.0f}° are expected at most; the strides were used. Frontal and "
                "transverse angles of this segment are doubtful; look at the mounting."
            )
            notices += (Notice("heading_disagreement", message, sensor=segment),)
    elif velocity is not None:
        sd = hypot(forward.velocity_sd, forward.velocity_error_mps / velocity.speed_mps)
        heard = (*heard, ForwardMeasure("velocity", velocity.angle, sd, forward.velocity_doubt))
    elif start is not None:
        heard = (
            *heard,
            ForwardMeasure("start_velocity", start.angle, forward.start_sd, forward.start_doubt),
        )
    return AnteriorAxis(
        chosen.angle,
        "walking_direction",
        chosen.score,
        notices,
        facts,
        measures=heard,
        mirror=mirror,
        kept=strides is not None,
    )


def list_axis_measures(
    segment: Segment, angle: float, axis: WalkingDirection, pca: FlexionAxis, params: ForwardParams
) -> tuple[tuple[ForwardMeasure, ...], ForwardMeasure | None]:
    """What the axes of acceleration and of turning say of the forward axis, and what the other side may use.

    Parameters
    ----------
    angle : of the forward axis, to within the half circle that gives both axes their sign, rad.
    """
    doubt = max(params.axis_doubt, 1.0 - axis.score)
    heard = [ForwardMeasure("acceleration", nearest_sign(axis.angle, angle), params.axis_sd, doubt)]
    # walking gives a trunk no sagittal axis of turning
    if segment in TRUNK or pca.rho < SINGLE_AXIS:
        return tuple(heard), None
    across = nearest_sign(-pca.gamma, angle)
    heard.append(ForwardMeasure("gyro_pca", across, params.pca_sd, params.pca_doubt))
    clear = pca.rho >= GOOD_AXIS
    return tuple(heard), (
        ForwardMeasure("mirror", across, params.mirror_sd, params.pca_doubt) if clear else None
    )


def weigh_axes(
    found: Mapping[Segment, AnteriorAxis], joints: Sequence[JointMeasure], params: ForwardParams
) -> dict[Segment, AnteriorAxis]:
    """The forward axes as all sensors together have them, with their uncertainty, told where it is large."""
    mirrors = {s: f.mirror for s, f in found.items() if f.mirror is not None}
    weighed = weigh_forward_axes({s: f.measures for s, f in found.items()}, joints, mirrors)
    better = {}
    for s, f in found.items():
        w = weighed[s]
        angle = f.angle if f.kept else w.angle
        votes = [
            {"source": v.source, "off_rad": subtract_angles(v.angle, angle), "share": v.share}
            for v in w.votes
        ]
        told = (_tell_uncertain(s, w.sd, params.tell_sd),) if w.sd > params.tell_sd else ()
        better[s] = replace(
            f, angle=angle, sd=w.sd, notices=f.notices + told, facts={**f.facts, "votes": votes}
        )
    return better


def _tell_uncertain(segment: Segment, sd: float, limit: float) -> Notice:
    return Notice(
        "forward_uncertain",
        f"{segment}: its way forward is known to ± {degrees(sd):.0f}° only; ± {degrees(limit):.0f}° is good. "
        "Frontal and transverse angles there are doubtful. Start straight ahead from standing and walk "
        "further.",
        sensor=segment,
    )


def _vaulting(
    segment: Segment, signals: SensorSignals, q: Floats, a: Complexes, angle: float, walk: CalibrationWalk
) -> float:
    """`pendulum_agreement` of a pelvis with a direction; 0 for the others."""
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
    """Flexion axis by gyro PCA, sign by declared mounting or the gait rules."""
    axis = flexion_axis(signals.gyr[walk.mask] - standing.gyro_bias, R_vertical, segment)
    angle, notices = _signed(segment, -axis.gamma, written, R_vertical, q, walk)
    if axis.rho < GOOD_AXIS:
        notices += (
            Notice(
                "not_single_axis",
                f"{segment}: the first component holds {axis.rho:.0%} of the movement, {GOOD_AXIS:.0%} or "
                "more is good; the flexion axis may be off by 10° and more.",
                sensor=segment,
            ),
        )
    said = ForwardMeasure("gyro_pca", angle, forward.pca_sd, forward.pca_doubt)
    return AnteriorAxis(angle, "gyro_pca", axis.rho, notices, {"rho": axis.rho}, measures=(said,), kept=True)


def _signed(
    segment: Segment, axis: float, written: float | None, R_vertical: Floats, q: Floats, walk: CalibrationWalk
) -> tuple[float, tuple[Notice, ...]]:
    """Choose the sign of an axis: by declared mounting first, then by the gait rules
    (docs/science/calibration.md, "Signs")."""
    if written is not None:
        angle = nearest_sign(axis, written)
        return angle, _sign_notices(segment, angle, R_vertical, q, walk)
    if segment in TRUNK:
        raise CalibrationError(
            "pelvis_heading_unknown",
            f"{segment}: which way it faces is not known, no standing is next to the walk. Stand still for "
            "3 s directly before walking, or declare the mounting, for example “sacrum, face backwards”.",
            sensor=segment,
        )
    margin = _margin(segment, axis, R_vertical, q, walk)
    if abs(margin) < WEAK_MARGIN:
        weak = Notice(
            "calibration_sign_weak",
            f"{segment}: forward and backward swing differ by {degrees(abs(margin)):.1f}° only, at least "
            f"{degrees(WEAK_MARGIN):.0f}° decide which way is forward. Check the sign of the curves, or "
            "declare the mounting.",
            sensor=segment,
        )
        return (axis if margin >= 0 else nearest_sign(axis, axis + np.pi)), (weak,)
    return (axis if margin > 0 else nearest_sign(axis, axis + np.pi)), ()


def _margin(segment: Segment, angle: float, R_vertical: Floats, q: Floats, walk: CalibrationWalk) -> float:
    return gait_margin(sagittal_course(q, about_vertical(-angle) @ R_vertical), walk.mask, segment)


def _sign_notices(
    segment: Segment, angle: float, R_vertical: Floats, q: Floats, walk: CalibrationWalk
) -> tuple[Notice, ...]:
    """Tell when the gait rule contradicts a sign found otherwise; velocity and declaration go first."""
    if segment in TRUNK:
        return ()
    margin = _margin(segment, angle, R_vertical, q, walk)
    if margin > -CLEAR_MARGIN:
        return ()
    return (
        Notice(
            "calibration_sign_conflict",
            f"{segment}: it swings {degrees(-margin):.0f}° further to the side where gait swings less. Check "
            "that it is mapped to the right segment and that the walk was forwards.",
            sensor=segment,
        ),
    )
