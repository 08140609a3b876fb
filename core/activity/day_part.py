"""One day of frames → wear, upright posture, lying, trunk leans and steps.

A recording is processed in days of 24 h from its start, each with a margin on both sides, so that events
across a day boundary are not missed; postures are then decided for the whole recording in
core/activity/postures.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sagittal.core.activity.frames import FRAME_HZ, PER_MINUTE, Frames, Singles, Slab, measure_length
from sagittal.core.activity.params import ActivityParams
from sagittal.core.activity.result import PosturalTransition, TransitionCandidate, WearPeriod
from sagittal.core.activity.stairs import measure_walking, tell_stairs
from sagittal.core.activity.transitions import (
    Lean,
    Lying,
    find_leans,
    find_lying,
    judge_leans,
    mark_near,
    tell_lying,
)
from sagittal.core.activity.wear import (
    Wear,
    describe_period,
    find_forward,
    find_upright,
    find_wear,
    group_periods,
)
from sagittal.core.events.bouts import plain_bouts
from sagittal.core.events.turns import Turn
from sagittal.core.frames import Bools, Floats
from sagittal.core.signals.rest import Window, find_runs

NEAR_LYING_S = 10.0
"""Leans so close to lying do not tell where forward is."""


@dataclass(frozen=True, eq=False)
class Posture:
    """Inclination of every frame.

    Parameters
    ----------
    known : (f,) sensor worn and upright direction known.
    tilt : (f,) in any direction, rad. lean : (f,) forward positive, rad; equal to the tilt if forward is
    unknown.
    signed : (f,) forward direction known.
    """

    known: Bools
    tilt: Singles
    lean: Singles
    signed: Bools


@dataclass(frozen=True, eq=False)
class DayPart:
    """Results of one day of a recording, in s since its first sample, restricted to that day.

    Parameters
    ----------
    no_baseline : sensor worn, upright direction unknown. tilted : inclined past the lying limit, but not
    still.
    step_kinds : (n,) of the steps, 0 level, 1 up, 2 down. step_rocks, step_leans : (n,) rad, the features
    used for that classification (core/activity/stairs.py). inclination_deg : (seconds,) NaN = unknown.
    """

    gaps: tuple[Window, ...]
    off: tuple[Window, ...]
    no_baseline: tuple[Window, ...]
    lying: tuple[Window, ...]
    tilted: tuple[Window, ...]
    periods: tuple[WearPeriod, ...]
    transitions: tuple[PosturalTransition, ...]
    candidates: tuple[TransitionCandidate, ...]
    steps_s: Floats
    step_kinds: np.ndarray
    step_rocks: Floats
    step_leans: Floats
    turns: tuple[Turn, ...]
    inclination_deg: Floats


def read_day(
    slab: Slab, day: Window, previous: WearPeriod | None, thigh_m: float, params: ActivityParams
) -> DayPart:
    """Analyse the time from `day[0]` to `day[1]`, s.

    Parameters
    ----------
    slab : the day with its margins. previous : the last wear period of the previous day, None without one.
    """
    frames = slab.frames
    offset = frames.first / FRAME_HZ
    wear = find_wear(frames, params.wear)
    steps = np.array(slab.steps_s)
    walking = _mark_walking(steps, frames, params)
    posture, periods = _find_posture(frames, wear, walking, previous, params)
    lying = find_lying(posture.tilt, frames, posture.known, params.transitions)
    posture, periods = _find_forward(frames, posture, periods, lying, walking, params)
    steps = steps[_are_upright(steps, frames, posture, params)] if len(steps) else steps
    walking = _mark_walking(steps, frames, params)
    leans = find_leans(posture.lean, posture.known, params.transitions)
    accepted, refused = judge_leans(leans, posture.lean, frames, lying, walking, thigh_m, params.transitions)
    accepted += tell_lying(lying, frames, posture.tilt)
    step_frames = [_index(t, frames) for t in steps]
    rocks, trunk = measure_walking(posture.lean, walking, step_frames, params.stairs)
    kinds = tell_stairs(rocks, trunk, params.stairs)

    def clip(ranges: Sequence[tuple[int, int]]) -> tuple[Window, ...]:
        windows = [
            (max(day[0], offset + a / FRAME_HZ), min(day[1], offset + b / FRAME_HZ)) for a, b in ranges
        ]
        return tuple(w for w in windows if w[1] > w[0])

    def holds(t: float) -> bool:
        return day[0] <= t < day[1]

    inside = (steps >= day[0]) & (steps < day[1])
    return DayPart(
        gaps=clip(wear.gaps),
        off=clip(wear.off),
        no_baseline=clip(find_runs(_mark(wear.worn, len(frames.valid)) & ~posture.known & frames.valid)),
        lying=clip([(x.a, x.b) for x in lying if x.still]),
        tilted=clip([(x.a, x.b) for x in lying if not x.still]),
        periods=_describe_periods(periods, day),
        transitions=tuple(sorted((t for t in accepted if holds(t.time_s)), key=lambda t: t.time_s)),
        candidates=tuple(c for c in refused if holds(c.time_s)),
        steps_s=steps[inside],
        step_kinds=kinds[inside],
        step_rocks=rocks[inside],
        step_leans=trunk[inside],
        turns=tuple(t for t in slab.turns if holds(t.start_s)),
        inclination_deg=_seconds(frames, posture, day),
    )


def _describe_periods(periods: Sequence[WearPeriod], day: Window) -> tuple[WearPeriod, ...]:
    """The wear periods that overlap a day, clipped to it."""
    return tuple(
        describe_period(
            max(day[0], p.start_s),
            min(day[1], p.end_s),
            _array(p.up),
            _array(p.forward),
            p.method,
            p.leans,
        )
        for p in periods
        if p.end_s > day[0] and p.start_s < day[1]
    )


def _index(t: float, frames: Frames) -> int:
    return int(np.clip(int(t * FRAME_HZ) - frames.first, 0, len(frames.valid) - 1))


def _mark(ranges: Sequence[tuple[int, int]], n: int) -> Bools:
    mask = np.zeros(n, np.bool_)
    for a, b in ranges:
        mask[a:b] = True
    return mask


def _mark_walking(steps: Floats, frames: Frames, params: ActivityParams) -> Bools:
    """Frames (f,) from the first to the last step of a bout."""
    bouts = plain_bouts(steps.tolist(), params.bouts)
    return _mark([(_index(b.first_s, frames), _index(b.end_s, frames)) for b in bouts], len(frames.valid))


def _are_upright(steps: Floats, frames: Frames, posture: Posture, params: ActivityParams) -> Bools:
    step_frames = np.array([_index(t, frames) for t in steps])
    return np.asarray(
        frames.valid[step_frames]
        & (~posture.known[step_frames] | (posture.tilt[step_frames] < params.upright_rad))
    )


def _find_posture(
    frames: Frames, wear: Wear, walking: Bools, previous: WearPeriod | None, params: ActivityParams
) -> tuple[Posture, list[WearPeriod]]:
    """Tilt from the upright direction of each period; a period without one uses that of its neighbour."""
    n, offset = len(frames.valid), frames.first / FRAME_HZ
    groups = group_periods(wear, params.wear)
    own = [find_upright(frames, walking, group, params.upright) for group in groups]
    sure = [axis for axis, method in own if method == "walking"]
    lent = _array(previous.up) if previous is not None else sure[0] if sure else None
    tilt, is_known = np.zeros(n, np.float32), np.zeros(n, np.bool_)
    worn_mask = _mark(wear.worn, n) & frames.valid
    periods = []
    for (a, b), (axis, method) in zip(groups, own, strict=True):
        if method != "walking" and lent is not None:
            axis, method = lent, "neighbour"
        elif method == "walking":
            lent = axis
        periods.append(describe_period(offset + a / FRAME_HZ, offset + b / FRAME_HZ, axis, None, method, 0))
        if axis is not None:
            is_known[a:b] = worn_mask[a:b]
            for part in _cut_hours(a, b):
                gravity = frames.gravity[part]
                size = np.maximum(measure_length(gravity), 1e-9)
                tilt[part] = np.arccos(np.clip(_along(gravity, axis) / size, -1.0, 1.0))
    tilt[~is_known] = 0.0
    return Posture(is_known, tilt, tilt, np.zeros(n, np.bool_)), periods


def _find_forward(
    frames: Frames,
    posture: Posture,
    periods: Sequence[WearPeriod],
    lying: Sequence[Lying],
    walking: Bools,
    params: ActivityParams,
) -> tuple[Posture, list[WearPeriod]]:
    """Signed inclination in periods whose leans reveal the forward direction."""
    close, longest = round(NEAR_LYING_S * FRAME_HZ), round(params.upright.lean_s * FRAME_HZ)
    near_lying = mark_near(lying, close, len(walking))
    leans = [
        x
        for x in find_leans(posture.tilt, posture.known, params.transitions)
        if not walking[x.top] and x.b - x.a <= longest and not near_lying[x.top]
    ]
    lean, signed = posture.tilt.copy(), np.zeros(len(posture.tilt), np.bool_)
    described = []
    for p in periods:
        a, b = (round(t * FRAME_HZ) - frames.first for t in (p.start_s, p.end_s))
        axis = _array(p.up)
        if axis is None:
            described.append(p)
            continue
        own: list[Lean] = [x for x in leans if a <= x.top < b]
        lean_frames = [(x.a, x.top, x.b) for x in own]
        forward, count = find_forward(frames.gravity, axis, lean_frames, params.upright)
        described.append(describe_period(p.start_s, p.end_s, axis, forward, p.method, count))
        if forward is not None:
            for part in _cut_hours(a, b):
                gravity = frames.gravity[part]
                lean[part] = np.arctan2(-_along(gravity, forward), _along(gravity, axis))
            signed[a:b] = posture.known[a:b]
    lean[~posture.known] = 0.0
    return Posture(posture.known, posture.tilt, lean, signed), described


def _seconds(frames: Frames, posture: Posture, day: Window) -> Floats:
    """Mean inclination (seconds,) in degrees for every second of the day, NaN if unknown."""
    a, b = (round(t * FRAME_HZ) - frames.first for t in day)
    inclination = np.full(-(-(b - a) // FRAME_HZ), np.nan)
    for part in _cut_hours(a, b):
        mask = posture.signed[part]
        firsts = np.arange(0, len(mask), FRAME_HZ)
        number = np.add.reduceat(mask, firsts, dtype=np.int8)
        total = np.add.reduceat(np.where(mask, posture.lean[part], np.float32(0.0)), firsts)
        second = (part.start - a) // FRAME_HZ
        inclination[second : second + len(firsts)] = np.where(
            number > 0, np.degrees(total / np.maximum(number, 1)), np.nan
        )
    return inclination


def _cut_hours(a: int, b: int) -> Iterator[slice]:
    """Frames a to b in slices of one hour, which limits the memory of double-precision intermediates."""
    for first in range(a, b, 60 * PER_MINUTE):
        yield slice(first, min(b, first + 60 * PER_MINUTE))


def _along(gravity: Singles, axis: Floats) -> Floats:
    """Projections (n,) of directions (n, 3) on an axis (3,), summed in double precision without a copy."""
    return np.asarray(np.einsum("ni,i->n", gravity, axis, dtype=np.float64))


def _array(axis: tuple[float, float, float] | None) -> Floats | None:
    return None if axis is None else np.array(axis)
