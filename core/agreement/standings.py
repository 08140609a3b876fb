"""Detection of slips before or at the start of walking, from standing before and after and the walk between.

The criterion of slips.py needs windows of walking before and after. At the edges of a walk three tilts are
compared: standing before, walking, standing after. A slip between the first two rotates both others relative
to the first, for this sensor alone. A leg placed forward tilts thigh and shank alike, a bent knee both; a
limp affects walking but not the standing after it. Equations: docs/science/agreement.md, "Slipped sensors".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.agreement.params import SlipParams
from sagittal.core.agreement.slips import SensorSlip
from sagittal.core.agreement.strides import SMOOTH_HZ, find_main_axis, find_swings
from sagittal.core.agreement.terms import SensorTerms
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Floats, Segment
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import Window, drop_false_rests, find_rest_windows, index_window

WITHIN_S: Final = 0.4
"""A thigh and a foot swing forward so near to their shank."""

PARTNER: Final[Mapping[Segment, Segment]] = {
    a: b for side in SIDES for a, b in ((THIGH[side], SHANK[side]), (SHANK[side], THIGH[side]))
}
"""Thigh and shank of a leg: standing with the leg elsewhere turns both alike."""

MIRRORED: Final[Mapping[Segment, Segment]] = {
    part[a]: part[b] for part in (THIGH, SHANK, FOOT) for a, b in (SIDES, SIDES[::-1])
}
"""The same segment of the other leg."""


@dataclass(frozen=True)
class StandingTurn:
    """Rotation of a sensor about its medio-lateral axis since the standing before a walk, forward positive,
    rad.

    Parameters
    ----------
    walking : to the mean of the walk, relative to the other leg. standing : to the standing after it, thigh
        and shank relative to each other, i.e. the change of the knee angle. axis : (3,) in sensor axes.
    """

    walking: float
    standing: float
    axis: Floats


def compare_standings(
    recording: UniformRecording, terms: Mapping[Segment, SensorTerms], params: SlipParams
) -> tuple[tuple[SensorSlip, ...], dict[Segment, Window]]:
    """Slips before the walk, at most one per sensor; and sensor → period in which it certainly did not slip.

    Both require standing before and after a walk, and sensors on the same segments of both legs.
    """
    legs = tuple(s for s in terms if s != "pelvis")
    slips: dict[Segment, SensorSlip] = {}
    stayed: dict[Segment, Window] = {}
    if not all(shank in terms for shank in SHANK.values()):
        return (), stayed
    rests = drop_false_rests(recording, find_rest_windows(recording, segments=legs))
    for first_rest, walk, second_rest in _list_walks(rests, terms, recording.rate_hz, params):
        turns = _measure_turns(recording, terms, first_rest, walk, second_rest)
        for segment, x in turns.items():
            if max(abs(x.walking), abs(x.standing)) < params.least_rad:
                until = stayed.get(segment, first_rest)
                stayed[segment] = (until[0], second_rest[1])
            elif segment not in slips and _has_slipped(segment, turns, params):
                middle_s, half = 0.5 * (first_rest[1] + walk[0]), 0.5 * (walk[0] - first_rest[1])
                along = tuple(float(v) for v in x.axis)
                sd = max(params.standing_sd_rad, 0.5 * abs(x.walking - x.standing))
                slip = SensorSlip(segment, middle_s, half, x.walking, sd, along, True)  # type: ignore[arg-type]
                slips[segment] = slip
    return tuple(slips.values()), {s: x for s, x in stayed.items() if s not in slips}


def _has_slipped(segment: Segment, turns: Mapping[Segment, StandingTurn], params: SlipParams) -> bool:
    """Whether walking and the standing after it are both explained by one rotation of this sensor alone."""
    x, side = turns[segment], segment[-1]
    size, same = abs(x.standing), x.walking * np.sign(x.standing)
    if not (
        params.least_rad < size < params.straight_rad
        and max(params.least_rad, params.agree * size) < same < params.straight_rad
    ):
        return False
    walking = [abs(y.walking) for s, y in turns.items() if s[-1] == side and s != segment]
    standing = [abs(y.standing) for s, y in turns.items() if s[-1] != side]
    most = params.alone_standing
    return max(walking, default=np.inf) < most * same and max(standing, default=np.inf) < most * size


def _list_walks(
    rests: tuple[Window, ...], terms: Mapping[Segment, SensorTerms], rate_hz: float, params: SlipParams
) -> Iterator[tuple[Window, Window, Window]]:
    """Every walk, from its first to its last mid-swing, with the first rest before and after it."""
    first = rests[0] if rests else None
    rates = [terms[SHANK[side]].motion.rate for side in SIDES]
    for a, b in pairwise(rests):
        gap = slice(round(a[1] * rate_hz), round(b[0] * rate_hz))
        swings: list[float] = []
        if gap.stop - gap.start > params.strides * rate_hz:
            for rate in rates:
                swings += (gap.start + find_swings(rate[gap], rate_hz)).tolist()
        if first is not None and len(swings) >= 2 * params.strides:
            yield first, (min(swings) / rate_hz, max(swings) / rate_hz), b
            first = b


def _measure_turns(
    recording: UniformRecording,
    terms: Mapping[Segment, SensorTerms],
    first_rest: Window,
    walk: Window,
    second_rest: Window,
) -> dict[Segment, StandingTurn]:
    rate_hz = recording.rate_hz
    measured: dict[Segment, tuple[float, float, Floats]] = {}
    for side in SIDES:
        part = index_window(walk, rate_hz)
        shank = terms[SHANK[side]].motion.rate[part]
        for segment in (s for s in terms if s.endswith(f"_{side[0]}")):
            axis = _find_forward_axis(terms[segment].motion.rate[part], shank, rate_hz)
            x = recording.sensors[segment]
            ups = []
            for window in (first_rest, walk, second_rest):
                samples = index_window(window, rate_hz)
                ok = x.valid[samples]
                ups.append(x.cut("acc", samples)[ok].mean(axis=0) if ok.any() else np.full(3, np.nan))
            walking, standing = (_turn_about(axis, ups[0], up) for up in ups[1:])
            if np.isfinite(walking + standing):
                measured[segment] = walking, standing, axis
    turns = {}
    for segment, (walking, standing, axis) in measured.items():
        opposite = MIRRORED[segment]
        beyond = PARTNER.get(segment)
        if opposite in measured and (beyond is None or beyond in measured):
            knee = 0.0 if beyond is None else measured[beyond][1]
            turns[segment] = StandingTurn(walking - measured[opposite][0], standing - knee, axis)
    return turns


def _find_forward_axis(rate: Floats, shank: Floats, rate_hz: float) -> Floats:
    """Axis (3,) of the largest rotation of a sensor, positive in swing like that of its shank; rates (n,
    3).
    """
    axis, along = find_main_axis(rate), find_main_axis(shank)
    leg = low_pass(shank @ along, SMOOTH_HZ, rate_hz)
    # a shank swings forward faster than it turns back
    leg *= np.sign(np.sum(leg**3))
    own = low_pass(rate @ axis, SMOOTH_HZ, rate_hz)
    reach = min(round(WITHIN_S * rate_hz), len(own) - 1)
    lobes = [
        float(np.sum(own[max(0, -k) : len(own) - max(0, k)] * leg[max(0, k) : len(leg) + min(0, k)]))
        for k in range(-reach, reach + 1)
    ]
    return np.asarray(axis * np.sign(max(lobes, key=abs)))


def _turn_about(axis: Floats, a: Floats, b: Floats) -> float:
    """Angle about an axis (3,) from one vector to another, rad."""
    return float(np.arctan2(np.cross(a, b) @ axis, a @ b - (a @ axis) * (b @ axis)))
