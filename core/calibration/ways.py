"""Walking directions of a sensor: from strides, from rest-to-rest velocity, and from the first steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees, hypot, radians

from sagittal.core.calibration.forward import ForwardMeasure, ForwardParams
from sagittal.core.calibration.heading import (
    Complexes,
    HeadingParams,
    Part,
    WalkingDirection,
    nearest_sign,
    rest_to_rest_velocity,
    start_direction,
    stride_direction,
    subtract_angles,
    velocity_direction,
)
from sagittal.core.calibration.sensor_in_walk import WalkRungParams, find_flat_moments
from sagittal.core.calibration.standing import SensorAtRest
from sagittal.core.calibration.walking import TRUNK
from sagittal.core.errors import Notice
from sagittal.core.frames import FOOT, Bools, Segment
from sagittal.core.message import Message
from sagittal.core.signals.recording import SensorSignals
from sagittal.core.signals.rest import Window

DISAGREEMENT = radians(15.0)
"""Difference of two measures of the walking direction that is told
(docs/science/real-recordings.md, "Heading")."""

COARSE = radians(30.0)
"""The same where velocity comes from one rest only: a tilt of 1° and 3 s make 0.5 m/s across (our choice)."""

STRONG_AXIS = 0.6
"""Share of the acceleration axis from which it goes before a velocity that disagrees with it. Fitted to
nothing: the shares were .73 to .97 on neura_walk and gaitmap_foot, .22 where the axis of a simulated pelvis
was wrong."""


@dataclass(frozen=True, eq=False)
class CalibrationWalk:
    """The straight walking used for the direction, relative to the calibration rest.

    Parameters
    ----------
    rest : the whole rest window. leads : it precedes the walk. parts : straight parts, the nearest first.
    bearing : heading change of each part since standing, rad. span : index range between two rests, None
    without a second rest near enough. mask : (n,) samples of the parts. steps_s : step time in each part,
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
class SignedWays:
    """Walking directions with a known sign; None if unavailable, or superseded by a better one.

    Parameters
    ----------
    strides : of a foot. velocity : from rest to rest. start : of the first steps after standing.
    """

    strides: WalkingDirection | None = None
    velocity: WalkingDirection | None = None
    start: WalkingDirection | None = None


@dataclass(frozen=True, eq=False)
class ChosenWay:
    """The chosen direction and its diagnostics.

    Parameters
    ----------
    off : deviation of the acceleration axis from the direction that determined the sign, rad.
    """

    chosen: WalkingDirection
    off: float
    facts: Mapping[str, object]


def measure_ways(
    segment: Segment,
    signals: SensorSignals,
    standing: SensorAtRest,
    a: Complexes,
    walk: CalibrationWalk,
    params: HeadingParams,
) -> SignedWays:
    """Compute the directions of one sensor; a : (n,) its horizontal acceleration, m/s²."""
    velocity = _rest_to_rest_direction(a, walk, params)
    strides = _by_strides(segment, signals, standing, a, walk, params)
    if strides is not None or velocity is not None:
        return SignedWays(strides, velocity)
    gap_s = params.trunk_gap_s if segment in TRUNK else params.leg_gap_s
    start = start_direction(
        a, walk.rest, walk.parts[0], walk.bearing[0], walk.leads, walk.rate_hz, gap_s, params
    )
    return SignedWays(start=start)


def _by_strides(
    segment: Segment,
    signals: SensorSignals,
    standing: SensorAtRest,
    a: Complexes,
    walk: CalibrationWalk,
    params: HeadingParams,
) -> WalkingDirection | None:
    """Direction of a foot's strides between foot-flat moments; None for other segments."""
    if segment not in FOOT.values():
        return None
    flats = find_flat_moments(
        signals.gyr - standing.gyro_bias, walk.mask & signals.valid, walk.rate_hz, WalkRungParams()
    )
    return stride_direction(a, flats, walk.parts, walk.bearing, walk.rate_hz, params)


def _rest_to_rest_direction(
    a: Complexes, walk: CalibrationWalk, params: HeadingParams
) -> WalkingDirection | None:
    """Direction of the velocity between two rests, None without a second one."""
    if walk.span is None:
        return None
    first, last = walk.span
    v = rest_to_rest_velocity(a[first:last], True, walk.rate_hz)
    inside = [(p, b) for p, b in zip(walk.parts, walk.bearing, strict=True) if first <= p[0] and p[1] <= last]
    return velocity_direction(v, first, [p for p, _ in inside], [b for _, b in inside], params)


def choose_way(ways: SignedWays, axis: WalkingDirection) -> ChosenWay | None:
    """The best of the directions, or the acceleration axis with its sign; None without any."""
    best = next((w for w in (ways.strides, ways.velocity, ways.start) if w is not None), None)
    if best is None:
        return None
    signed = WalkingDirection(nearest_sign(axis.angle, best.angle), axis.score)
    off = subtract_angles(signed.angle, best.angle)
    if best is ways.strides:
        return ChosenWay(best, off, {"source": "strides", "disagreement_rad": off})
    if best is ways.velocity:
        if abs(off) > DISAGREEMENT and axis.score > STRONG_AXIS:
            # one lost impact bends an integrated velocity, many strides hold the axis
            return ChosenWay(signed, off, {"source": "acceleration", "disagreement_rad": off})
        return ChosenWay(best, off, {"source": "velocity", "disagreement_rad": off})
    if abs(off) > COARSE and axis.score <= STRONG_AXIS:
        facts = {"source": "velocity", "sign": "velocity", "disagreement_rad": off}
        return ChosenWay(WalkingDirection(best.angle, 0.5), off, facts)
    return ChosenWay(signed, off, {"source": "acceleration", "sign": "velocity", "disagreement_rad": off})


def list_ways(
    ways: SignedWays, heard: tuple[ForwardMeasure, ...], params: ForwardParams
) -> tuple[ForwardMeasure, ...]:
    """Forward-axis measures: those of the axes followed by the best direction; strides replace all others."""
    if ways.strides is not None:
        return (ForwardMeasure("strides", ways.strides.angle, params.strides_sd, params.strides_doubt),)
    if ways.velocity is not None:
        sd = hypot(params.velocity_sd, params.velocity_error_mps / ways.velocity.speed_mps)
        return (*heard, ForwardMeasure("velocity", ways.velocity.angle, sd, params.velocity_doubt))
    if ways.start is not None:
        start = ForwardMeasure("start_velocity", ways.start.angle, params.start_sd, params.start_doubt)
        return (*heard, start)
    return heard


def tell_disagreement(segment: Segment, off: float) -> Notice:
    """Notice that strides and acceleration give different directions, `off` rad apart."""
    return Notice(
        "heading_disagreement",
        Message(
            "{segment}: the forward directions from strides and from acceleration differ by {abs:.0f}° "
            "(expected up to {DISAGREEMENT:.0f}°); strides were used. Frontal and transverse angles of "
            "this segment are unreliable; check its alignment.",
            segment=segment,
            abs=abs(degrees(off)),
            DISAGREEMENT=degrees(DISAGREEMENT),
        ),
        sensor=segment,
    )
