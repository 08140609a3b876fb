"""Quiet standing: the rest used for calibration, and per sensor the vertical and the gyroscope bias."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import radians

import numpy as np

from sagittal.core.errors import SignalError
from sagittal.core.frames import SHANK, THIGH, Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.signals.rest import (
    QuietParams,
    RestParams,
    Window,
    drop_false_rests,
    find_rest_windows,
    find_runs,
    index_window,
    measure_quietness,
)

LONGEST_S = 8.0
"""Rest that is used, s; 1, 2, 3, 5 and 8 s gave the same angles within 0.1°
(docs/science/calibration.md, "Standing")."""

MARGIN_S = 0.25
"""Part of a rest next to movement that is left out, s, where the rest is long enough."""

GOOD_S = 2.0
"""A rest of this length is taken before a longer one further from the walk, s (our choice)."""

LONG_WALK_S = 10.0
"""A walk this long, or half as long as the longest, is not the putting on of sensors (our choice)."""

PAUSE_S = 1.0
"""Movement so close before and after a short rest makes it a pause in a walk, s (our choice)."""

LEG_AHEAD = radians(6.0)
"""From here on one leg was ahead of the other. Standings of real and virtual people have up to 4°, stops in
mid-stride 7° and more for steps of 0.3 m, 10 to 20° for longer ones
(docs/science/calibration.md, "Standing").
"""

NORM_RANGE = (7.0, 13.0)
"""|f| at rest that can be gravity in m/s²; real sensors are within 6.6 % of 9.81
(docs/science/calibration.md, "Standing")."""

WOBBLE_FACTOR = 2.5
"""Up to this many times the gyro limit a failed rest is called not still, beyond it no rest (our choice)."""


@dataclass(frozen=True, eq=False)
class SensorAtRest:
    """One sensor at rest.

    Parameters
    ----------
    up : (3,) unit vector, vertical in sensor coordinates. gyro_bias : (3,) rad/s. rest_norm : |f|, m/s².
    """

    up: Floats
    gyro_bias: Floats
    rest_norm: float


def measure_standing(
    signals: SensorSignals, rate_hz: float, window: Window, segment: Segment
) -> SensorAtRest:
    """Mean specific force and mean rate of a sensor over a rest window.

    Raises
    ------
    SignalError `unit_suspect` if the value at rest cannot be gravity in m/s².
    """
    part = index_window(window, rate_hz)
    ok = signals.valid[part]
    force, bias = signals.acc[part][ok].mean(axis=0), signals.gyr[part][ok].mean(axis=0)
    norm = float(np.linalg.norm(force))
    if not NORM_RANGE[0] <= norm <= NORM_RANGE[1]:
        raise SignalError(
            "unit_suspect",
            Message(
                "{segment}: the accelerometer reads {norm:.2f} m/s² at rest, expected 9.81 ± 10 %. "
                "Near 1 the unit is g, near 0 gravity was removed: declare the unit, or export raw "
                "accelerations.",
                segment=segment,
                norm=norm,
            ),
            sensor=segment,
            t_s=window[0],
        )
    return SensorAtRest(force / norm, bias, norm)


def vertical_frame(up: Floats) -> Floats:
    """Rows (x, y, z) of the vertical frame in sensor coordinates, y = up
    (docs/science/calibration.md, "Standing").

    The seed axis is the sensor's x, or its z when x is within 26° of vertical (|up_x| > 0.9).
    """
    if abs(up[0]) <= 0.9:
        z = np.cross([1.0, 0.0, 0.0], up)
        z /= np.linalg.norm(z)
        x = np.cross(up, z)
    else:
        x = np.cross(up, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        z = np.cross(x, up)
    return np.stack((x, up, z))


def find_rests(recording: UniformRecording, params: RestParams) -> tuple[Window, ...]:
    """All windows with every sensor at rest, excluding those with slow movement of one of them.

    Raises
    ------
    SignalError `rest_too_short`, `not_still` or `no_rest`, with the quietest moment found.
    """
    windows = find_rest_windows(recording, params)
    if rests := drop_false_rests(recording, windows, params):
        return rests
    if windows:
        raise SignalError(
            "not_still",
            Message(
                "No quiet standing detected: even in the quietest seconds a sensor rotates by more than "
                "{drift:.0f}°. Ask the person to stand still for 3 to 5 s before or after walking.",
                drift=np.degrees(params.drift),
            ),
            t_s=windows[0][0],
        )
    quietest: list[tuple[float, Segment, float]] = []
    for segment, signals in recording.sensors.items():
        q = measure_quietness(signals, recording.rate_hz, params)
        quietest_sample = int(np.argmin(q.gyro))
        quietest.append((float(q.gyro[quietest_sample]), segment, float(recording.t_s[quietest_sample])))
    rate, segment, at_s = max(quietest)
    short = QuietParams(params.window_s / 2, params.gyro_limit, params.acc_std_limit, params.shortest_s / 2)
    limit = np.degrees(params.gyro_limit)
    if find_rest_windows(recording, short):
        code, problem = (
            "rest_too_short",
            f"the sensors are still together for less than {params.shortest_s:g} s",
        )
    elif rate < params.gyro_limit:
        code, problem = "no_rest", "every sensor is still at some time, but never all of them together"
    elif rate < WOBBLE_FACTOR * params.gyro_limit:
        code = "not_still"
        problem = Message(
            "{segment} moves at {rate:.1f} °/s in its quietest second, limit {limit:.0f} °/s",
            segment=segment,
            rate=np.degrees(rate),
            limit=limit,
        )
    else:
        code = "no_rest"
        problem = Message(
            "the quietest second of {segment} has {rate:.0f} °/s, limit {limit:.0f} °/s",
            segment=segment,
            rate=np.degrees(rate),
            limit=limit,
        )
    raise SignalError(
        code,
        Message(
            "No quiet standing detected: {what}. Ask the person to stand still for 3 to 5 s before or "
            "after walking.",
            what=problem,
        ),
        sensor=segment if np.isfinite(rate) else None,
        t_s=at_s,
    )


def drop_pauses(rests: tuple[Window, ...], moving: Bools, rate_hz: float) -> tuple[Window, ...]:
    """The rests suitable as standing: drops those shorter than 2 s with movement right before and after.

    In a pause while walking, one foot is ahead of the other.

    Parameters
    ----------
    rests : rest windows in order. moving : (n,) True while walking.
    """
    reach = round(PAUSE_S * rate_hz)

    def is_pause(window: Window) -> bool:
        part = index_window(window, rate_hz)
        preceding, following = (
            moving[max(0, part.start - reach) : part.start],
            moving[part.stop : part.stop + reach],
        )
        return window[1] - window[0] < GOOD_S and bool(preceding.any() and following.any())

    return tuple(r for r in rests if not is_pause(r))


def measure_leg_ahead(tilt: Mapping[Segment, float]) -> float:
    """How far one leg was ahead of the other while standing, rad; 0 if no leg sensors show it.

    When standing with the feet side by side both legs deviate equally from their mean posture in walking. In
    a step position thigh and shank of one leg are both tilted forward relative to the other's; a knee that
    does not extend, a rotated axis or a slipped sensor tilts only one of them, or both in opposite
    directions.

    Parameters
    ----------
    tilt : segment → mean sagittal inclination in straight walking relative to standing, rad.

    Returns
    -------
    The smaller of the differences between the thighs and between the shanks if they have the same sign, else
    0. With only one of the two pairs half of its difference.
    """
    apart = [
        tilt[pair["left"]] - tilt[pair["right"]]
        for pair in (THIGH, SHANK)
        if pair["left"] in tilt and pair["right"] in tilt
    ]
    if not apart:
        return 0.0
    if len(apart) == 1:
        return 0.5 * abs(apart[0])
    return min(map(abs, apart)) if apart[0] * apart[1] > 0.0 else 0.0


def choose_rest(rests: tuple[Window, ...], moving: Bools, rate_hz: float) -> Window:
    """The rest to calibrate on: the last good one before the first long walk, else the first good one after
    it.

    A long walk, not the first movement: a recording may begin with sensors on a table before they are put on.

    Parameters
    ----------
    rests : rest windows in order. moving : (n,) True while walking.

    Returns
    -------
    At most 8 s of the chosen rest, at the end next to the walk.
    """
    walks = [(a / rate_hz, b / rate_hz) for a, b in find_runs(moving)]
    long = min(LONG_WALK_S, 0.5 * max((b - a for a, b in walks), default=0.0))
    start, end = next(((a, b) for a, b in walks if b - a >= long), (np.inf, np.inf))
    earlier = [r for r in rests if r[1] <= start + 0.5 * GOOD_S]
    later = [r for r in rests if r[0] >= end - 0.5 * GOOD_S]
    near = [r for r in (*reversed(earlier), *later) if r[1] - r[0] >= GOOD_S]
    first, last = near[0] if near else max(rests, key=lambda r: r[1] - r[0])
    margin = MARGIN_S if last - first > 1.0 + 2 * MARGIN_S else 0.0
    if not walks or any(a > last - 0.5 * GOOD_S for a, _ in walks):
        last -= margin
        return max(first, last - LONGEST_S), last
    first += margin
    return first, min(last, first + LONGEST_S)


def stand_all(
    recording: UniformRecording, window: Window, rests: tuple[Window, ...], params: RestParams
) -> Mapping[Segment, SensorAtRest]:
    """Standing data of every sensor over one window, with the gyroscope bias checked against the longest
    rest.

    The mean rate of a sensor that rotated slowly while the person stood is not its bias.
    """
    rate = recording.rate_hz
    longest = max(rests, key=lambda r: r[1] - r[0])
    longer = longest[1] - longest[0] > window[1] - window[0]
    by_segment = {}
    for s, x in recording.sensors.items():
        own = measure_standing(x, rate, window, s)
        if longer:
            part = index_window(longest, rate)
            bias = x.gyr[part][x.valid[part]].mean(axis=0)
            if float(np.linalg.norm(bias - own.gyro_bias)) > params.bias:
                own = replace(own, gyro_bias=bias)
        by_segment[s] = own
    return by_segment
