"""Daily-life monitor: processes a recording of any length from one sensor in bounded memory."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sagittal.core.activity.day_part import DayPart, read_day
from sagittal.core.activity.frames import FRAME_HZ, FrameStore, Slab
from sagittal.core.activity.params import ActivityParams, StairParams
from sagittal.core.activity.postures import FixedStretch, decide_postures
from sagittal.core.activity.reduction import reduce_stream
from sagittal.core.activity.result import (
    ActivityBout,
    ActivityResult,
    PosturalTransition,
    TransitionCandidate,
    WearPeriod,
)
from sagittal.core.activity.stairs import KIND_OF, LEVEL, StepKind, calibrate_stairs
from sagittal.core.activity.totals import HOUR_S, sum_days, sum_hours
from sagittal.core.body.model import NOMINAL_HEIGHT_M
from sagittal.core.errors import Notice, SignalError
from sagittal.core.events.bouts import Bout, plain_bouts
from sagittal.core.events.turns import Turn
from sagittal.core.frames import Floats, Segment
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.core.signals.rest import Window
from sagittal.core.signals.sample_blocks import LongStream

DAY_SLABS_S: Final = 86400
AROUND_S: Final = 2400
"""A day is read with so much around it: more than the shortest non-wear."""

LEAST_STEPS: Final = 5
"""Steps of each kind on which a person's own limits of stairs rest, at least [our choice]."""

Progress = Callable[[float], None]
"""Called with the share of the recording that was gone through, 0 to 1."""


def monitor_activity(
    stream: LongStream,
    segment: Segment,
    height_m: float | None = None,
    params: ActivityParams | None = None,
    progress: Progress = lambda share: None,
) -> ActivityResult:
    """Analyse a daily-life recording.

    Parameters
    ----------
    segment : "chest" or "pelvis". height_m : to estimate thigh length; None = nominal height, with a notice.

    Raises
    ------
    SignalError : `sample_rate_too_low`, `bad_signal`, `clock_jump`.
    """
    params = params or ActivityParams()
    height = NOMINAL_HEIGHT_M if height_m is None else height_m
    parts, end_s = _read_days(stream, segment, height, params, progress)
    return _put_together(stream, segment, height, parts, end_s, _say(stream, height_m, parts), params)


def calibrate_on_walks(
    stream: LongStream,
    segment: Segment,
    walks: Mapping[StepKind, Window],
    height_m: float | None = None,
    params: ActivityParams | None = None,
) -> StairParams:
    """Personal stair thresholds from one recording of level walking, stair ascent and stair descent.

    Parameters
    ----------
    walks : "walking", "stairs_up", "stairs_down" → time window, s from the recording's first sample.

    Raises
    ------
    SignalError as `monitor_activity`, and `walk_too_short` if one of them has fewer than `LEAST_STEPS` usable
    steps. ParameterError : `stairs_not_told_apart`.
    """
    params = params or ActivityParams()
    parts, _ = _read_days(stream, segment, NOMINAL_HEIGHT_M if height_m is None else height_m, params)
    steps, rocks, leans = (
        np.concatenate([getattr(p, name) for p in parts]) for name in ("steps_s", "step_rocks", "step_leans")
    )

    def measure(kind: StepKind) -> tuple[Floats, Floats]:
        start_s, end_s = walks[kind]
        own = (steps >= start_s) & (steps <= end_s) & np.isfinite(rocks)
        count = int(np.count_nonzero(own))
        if count < LEAST_STEPS:
            raise SignalError(
                "walk_too_short",
                Message(
                    f"From {{start_s:g}} to {{end_s:g}} s only {{count}} {plural(count, 'step', 'steps')} "
                    "can be assessed for '{kind}'; expected {LEAST_STEPS}. Record 20 steps of each without "
                    "stopping.",
                    start_s=start_s,
                    end_s=end_s,
                    count=count,
                    kind=kind,
                    LEAST_STEPS=LEAST_STEPS,
                ),
                sensor=stream.device_id,
                t_s=start_s,
            )
        return rocks[own], leans[own]

    return calibrate_stairs(measure("walking"), measure("stairs_up"), measure("stairs_down"), params.stairs)


def _read_days(
    stream: LongStream,
    segment: Segment,
    height_m: float,
    params: ActivityParams,
    progress: Progress = lambda share: None,
) -> tuple[list[DayPart], float]:
    """Results of each day, and the end of the last one, s."""
    if stream.rate_hz < params.min_rate_hz:
        raise SignalError(
            "sample_rate_too_low",
            Message(
                "Sensor {device_id} was recorded at {rate_hz:g} Hz; at least {min_rate_hz:g} Hz are "
                "needed to find steps. Record at 25 Hz or more.",
                device_id=stream.device_id,
                rate_hz=stream.rate_hz,
                min_rate_hz=params.min_rate_hz,
            ),
            sensor=stream.device_id,
        )
    thigh = params.transitions.thigh_share * height_m
    parts: list[DayPart] = []
    end_s = 0.0
    previous: WearPeriod | None = None
    slabs = _tell_hours(reduce_stream(stream, segment, params), stream.duration_s, progress)
    for slab, day in _days(slabs, params):
        part = read_day(slab, day, previous, thigh, params)
        parts.append(part)
        previous = next((p for p in reversed(part.periods) if p.up is not None), previous)
        end_s = day[1]
    return parts, end_s


def _tell_hours(slabs: Iterator[Slab], duration_s: float, progress: Progress) -> Iterator[Slab]:
    """Pass the slabs through, reporting `progress` after each full hour."""
    reported_s = 0.0
    for slab in slabs:
        end = (slab.frames.first + len(slab.frames.valid)) / FRAME_HZ
        if end - reported_s >= HOUR_S and duration_s > 0.0:
            progress(min(1.0, end / duration_s))
            reported_s = end
        yield slab


def _days(slabs: Iterator[Slab], params: ActivityParams) -> Iterator[tuple[Slab, Window]]:
    """Yield every day with its margins as one slab, together with its time range."""
    per_day, around = DAY_SLABS_S // params.slab_s, -(-AROUND_S // params.slab_s)
    per_slab = params.slab_s * FRAME_HZ
    store = FrameStore((per_day + 2 * around + 1) * per_slab)
    steps: list[float] = []
    turns: list[Turn] = []
    number = 0

    def look(until: int) -> tuple[Slab, Window]:
        """The current day with its margins."""
        day = (number * DAY_SLABS_S, min(store.end / FRAME_HZ, (number + 1) * DAY_SLABS_S))
        frames, end_s = store.view(until), until / FRAME_HZ
        return Slab(
            frames, tuple(t for t in steps if t < end_s), tuple(t for t in turns if t.start_s < end_s)
        ), day

    def drop() -> None:
        """Discard all data not needed for the next day."""
        nonlocal number, steps, turns
        number += 1
        first = max(0, number * per_day - around) * per_slab
        store.drop_before(first)
        steps = [t for t in steps if t >= first / FRAME_HZ]
        turns = [t for t in turns if t.start_s >= first / FRAME_HZ]

    for slab in slabs:
        store.append(slab.frames)
        steps += slab.steps_s
        turns += slab.turns
        until = ((number + 1) * per_day + around) * per_slab
        if slab.frames.first >= until:
            yield look(until)
            drop()
    while number * DAY_SLABS_S < store.end / FRAME_HZ:
        yield look(store.end)
        drop()


def _put_together(
    stream: LongStream,
    segment: Segment,
    height_m: float,
    parts: Sequence[DayPart],
    end_s: float,
    notices: tuple[Notice, ...],
    params: ActivityParams,
) -> ActivityResult:
    """Combine the days: bouts and postures may continue past midnight."""
    steps = np.concatenate([p.steps_s for p in parts]) if parts else np.empty(0)
    kinds = np.concatenate([p.step_kinds for p in parts]) if parts else np.empty(0, int)
    far = np.diff(steps, prepend=-np.inf) > 0.5 * params.steps.step_s[0]
    steps, kinds = steps[far], kinds[far]
    candidate_bouts = plain_bouts(steps.tolist(), params.bouts)
    walked = np.zeros(len(steps), np.bool_)
    for w in candidate_bouts:
        walked[_within(steps, w.first_s, w.end_s)] = True
    steps, kinds = steps[walked], kinds[walked]
    transitions = [t for p in parts for t in p.transitions]
    candidates = [c for p in parts for c in p.candidates]
    walks, transitions, refused = _meet(candidate_bouts, transitions)
    candidates = sorted((*candidates, *refused), key=lambda c: c.time_s)
    fixed = _fix(parts, walks, steps, kinds)
    spans, checked = decide_postures(
        end_s,
        fixed,
        _merge_windows([w for p in parts for w in p.tilted]),
        transitions,
        candidates,
        params.longest_stand_s,
    )
    bouts = tuple(_describe(w, steps, kinds) for w in walks)
    return ActivityResult(
        segment=segment,
        device_id=stream.device_id,
        source=stream.source,
        rate_hz=stream.rate_hz,
        has_gyro=stream.has_gyro,
        started_at=stream.started_at,
        duration_s=end_s,
        height_m=height_m,
        spans=spans,
        transitions=checked,
        candidates=tuple(candidates),
        bouts=bouts,
        steps_s=steps,
        turns=tuple(t for p in parts for t in p.turns),
        hours=sum_hours(end_s, stream.started_at, spans, steps),
        days=sum_days(end_s, stream.started_at, spans, steps, bouts, checked),
        periods=tuple(x for p in parts for x in p.periods),
        inclination_deg=np.concatenate([p.inclination_deg for p in parts]) if parts else np.empty(0),
        notices=notices,
    )


def _meet(
    walks: Sequence[Bout], transitions: Sequence[PosturalTransition]
) -> tuple[list[Bout], list[PosturalTransition], list[TransitionCandidate]]:
    """Start walking after rising and end it before sitting down; drop transitions in the middle of
    walking.
    """
    retained, refused = [], []
    ranges = {i: [w.start_s, w.end_s] for i, w in enumerate(walks)}
    starts = np.array([w.start_s for w in walks])
    for t in transitions:
        i = int(np.searchsorted(starts, t.time_s, "right")) - 1
        if t.rise_m is None or i < 0 or t.time_s >= ranges[i][1]:
            retained.append(t)
            continue
        a, b = ranges[i]
        if t.kind == "sit_to_stand" and t.time_s - a < min(3.0, 0.5 * (b - a)):
            ranges[i][0] = t.time_s
            retained.append(t)
        elif t.kind == "stand_to_sit" and b - t.time_s < min(3.0, 0.5 * (b - a)):
            ranges[i][1] = t.time_s
            retained.append(t)
        else:
            refused.append(
                TransitionCandidate(
                    t.time_s, t.start_s, t.end_s, t.lean_deg, t.rise_m, "while_walking", t.kind
                )
            )
    met = [replace(w, start_s=ranges[i][0], end_s=ranges[i][1]) for i, w in enumerate(walks)]
    return met, retained, refused


def _fix(
    parts: Sequence[DayPart], walks: Sequence[Bout], steps: Floats, kinds: np.ndarray
) -> list[FixedStretch]:
    """Certain stretches in chronological order without overlap; earlier classes take precedence."""
    return _lay_by_rank(
        (
            [FixedStretch(a, b, "gap", "no_samples") for p in parts for a, b in p.gaps],
            [FixedStretch(a, b, "non_wear", "no_movement") for p in parts for a, b in p.off],
            [FixedStretch(a, b, "unknown", "no_baseline") for p in parts for a, b in p.no_baseline],
            [
                FixedStretch(a, b, "lying", "inclination")
                for a, b in _merge_windows([w for p in parts for w in p.lying])
            ],
            [x for w in walks for x in _cut_stairs(w, steps, kinds)],
        )
    )


def _lay_by_rank(classes: Sequence[Sequence[FixedStretch]]) -> list[FixedStretch]:
    """Stretches in chronological order; of two that overlap, the one of the earlier class is kept."""
    placed: list[FixedStretch] = []
    for stretches in classes:
        starts = [x.start_s for x in placed]
        free = []
        for x in stretches:
            cursor_s = x.start_s
            for occupied in placed[max(0, bisect_right(starts, x.start_s) - 1) :]:
                if occupied.start_s >= x.end_s:
                    break
                if occupied.start_s > cursor_s:
                    free.append(replace(x, start_s=cursor_s, end_s=occupied.start_s))
                cursor_s = max(cursor_s, occupied.end_s)
            if cursor_s < x.end_s:
                free.append(replace(x, start_s=cursor_s))
        placed = sorted((*placed, *free), key=lambda x: x.start_s)
    return placed


def _cut_stairs(walk: Bout, steps: Floats, kinds: np.ndarray) -> list[FixedStretch]:
    """Split a bout where its steps change between level walking and stairs."""
    own = _within(steps, walk.start_s, walk.end_s)
    steps, kinds = steps[own], kinds[own]
    if not len(steps):
        return [FixedStretch(walk.start_s, walk.end_s, "walking", "steps")]
    changes = np.flatnonzero(np.diff(kinds)) + 1
    edges = [walk.start_s, *(0.5 * (steps[i - 1] + steps[i]) for i in changes), walk.end_s]
    firsts = [0, *changes.tolist()]
    return [
        FixedStretch(float(edges[k]), float(edges[k + 1]), KIND_OF[int(kinds[first])], "steps")
        for k, first in enumerate(firsts)
    ]


def _within(steps: Floats, start_s: float, end_s: float) -> slice:
    """Steps between two times, both included."""
    return slice(int(np.searchsorted(steps, start_s)), int(np.searchsorted(steps, end_s, "right")))


def _describe(walk: Bout, steps: Floats, kinds: np.ndarray) -> ActivityBout:
    own = kinds[_within(steps, walk.first_s, walk.end_s)]
    counts = [int(np.count_nonzero(own == kind)) for kind in range(len(KIND_OF))]
    return ActivityBout(
        start_s=walk.start_s,
        end_s=walk.end_s,
        kind=KIND_OF[int(np.argmax(counts))] if len(own) else KIND_OF[LEVEL],
        steps=len(own),
        stairs_up_steps=counts[1],
        stairs_down_steps=counts[2],
        cadence_spm=60.0 / walk.step_s,
    )


def _merge_windows(windows: Sequence[Window]) -> list[Window]:
    """Merge adjacent windows."""
    merged: list[Window] = []
    for a, b in sorted(windows):
        if merged and a <= merged[-1][1] + 1e-6:
            merged[-1] = (merged[-1][0], max(b, merged[-1][1]))
        else:
            merged.append((a, b))
    return merged


def _say(stream: LongStream, height_m: float | None, parts: Sequence[DayPart]) -> tuple[Notice, ...]:
    """Notices for the reader."""
    messages = list(stream.notices)
    if height_m is None:
        messages.append(
            Notice(
                "height_assumed",
                Message(
                    "Body height is missing; {NOMINAL_HEIGHT_M:.2f} m is assumed. It determines how far the "
                    "chest must rise to count as standing up.",
                    NOMINAL_HEIGHT_M=NOMINAL_HEIGHT_M,
                ),
                severity="info",
            )
        )
    periods = [p for part in parts for p in part.periods]
    if periods and all(p.method == "none" for p in periods):
        messages.append(
            Notice(
                "no_baseline",
                "No walking and no still period of 5 s detected, so the vertical is unknown. Postures are "
                "not classified; include some walking in the recording.",
                stream.device_id,
            )
        )
    elif any(p.method == "first_rest" for p in periods):
        messages.append(
            Notice(
                "baseline_assumed",
                "No walking detected, so the first 5 s of rest are assumed to be upright. If the person was "
                "lying then, all postures are wrong.",
                stream.device_id,
            )
        )
    if any(p.up is not None and p.forward is None for p in periods):
        messages.append(
            Notice(
                "forward_unknown",
                "During part of the wear time no trunk lean showed the forward direction; inclination has no "
                "sign there and is excluded.",
                stream.device_id,
                severity="info",
            )
        )
    return tuple(messages)
