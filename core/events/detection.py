"""Orientations → GaitEvents: the contacts of each foot, with notices.

`detect_contacts` is the default detector: based on pitch and movement, refined to the moment of contact.
`detect` is the foot-pitch rule of the thesis as published, for comparison. Source: docs/science/events.md,
"Foot-pitch rule", "Refinement" and "Refusals".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from sagittal.core.errors import Notice, SignalError
from sagittal.core.events.choice import believes_way
from sagittal.core.events.foot_contact import (
    ContactReports,
    FootContactParams,
    FootContactState,
    advance_foot_contacts,
)
from sagittal.core.events.foot_movement import FootMovement, FootMovements
from sagittal.core.events.foot_pitch import FootPitchParams, FootPitchState, advance_foot_pitch, pitch_signal
from sagittal.core.events.foot_way import FootWayParams, FootWayState, advance_foot_ways
from sagittal.core.events.result import EventKind, GaitEvent, GaitEvents
from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Segment, Side
from sagittal.core.message import Message
from sagittal.core.rotation import angle_between
from sagittal.core.signals.held_samples import compare_neighbours, cut_blocks

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from sagittal.core.fusion.orientations import Orientations

SOURCE: Final = "foot_contact"
"""The detector of the product."""
PITCH_RULE: Final = "foot_pitch"
"""The published rule."""
KINDS: Final[tuple[EventKind, EventKind]] = ("tc", "ic")


@dataclass(frozen=True)
class PitchFigures:
    """Statistics of one foot: extremes of s, its level at rest and in mid-stance or None, and number of
    events.
    """

    s_min: float
    s_max: float
    s_quiet: float | None
    s_flat: float | None
    n_ic: int
    n_tc: int


def detect_contacts(
    orientations: Orientations,
    pitch: FootPitchParams | None = None,
    params: FootContactParams | None = None,
    motions: Mapping[Segment, FootMovement | FootMovements] | None = None,
    ways: FootWayParams | None = None,
) -> GaitEvents:
    """Contacts of each foot with a sensor, at the moment of contact, with their uncertainty.

    Parameters
    ----------
    orientations : with "foot_l", "foot_r" or both; a missing foot gives the notice `foot_missing`.
    motions : movement of each foot; without it swings are detected, and contacts refined, from pitch alone.
    ways : of swings detected from displacement, used for a foot that pitch misreads.

    Returns
    -------
    Events in chronological order; diagnostics: foot → PitchFigures.

    Raises
    ------
    SignalError : `sample_rate_too_low`.
    """
    rule = pitch or FootPitchParams()

    def find(side: Side) -> tuple[list[GaitEvent], bool]:
        state = FootContactState.start(orientations.rate_hz, rule, params)
        motion = (motions or {}).get(FOOT[side])
        q, valid = orientations.q[FOOT[side]], orientations.valid[FOOT[side]]
        latest: dict[int, GaitEvent] = {}
        for part in cut_blocks(len(q)):
            moved = None if motion is None else motion.cut(part)
            signals = () if moved is None else (moved.speed, moved.acc)
            reports = advance_foot_contacts(state, q[part], valid[part], *signals)
            for _ in read_reports(reports, side, float(orientations.t_s[0]), orientations.rate_hz, latest):
                pass
        by_pitch = list(latest.values())
        if motion is None:
            return by_pitch, False
        by_way = find_by_way(orientations, side, motion, ways)
        swings = [(off.time_s, on.time_s) for off, on in zip(by_way[::2], by_way[1::2], strict=True)]
        landed = [e.time_s for e in by_pitch if e.kind == "ic"]
        return (by_way, True) if believes_way(swings, landed) else (by_pitch, False)

    return _each_foot(orientations, rule, find)


def find_by_way(
    orientations: Orientations,
    side: Side,
    motion: FootMovement | FootMovements,
    params: FootWayParams | None = None,
) -> list[GaitEvent]:
    """Contacts of one foot by the way it moves, at the person's own level of rest over the whole take."""
    state = FootWayState.start(orientations.rate_hz, params)
    q, valid = orientations.q[FOOT[side]], orientations.valid[FOOT[side]]
    for part in cut_blocks(len(q)):
        state.learn(q[part], valid[part])
    latest: dict[int, GaitEvent] = {}
    for part in cut_blocks(len(q)):
        reports = advance_foot_ways(state, q[part], valid[part], motion.cut(part).acc)
        for _ in read_reports(reports, side, float(orientations.t_s[0]), orientations.rate_hz, latest):
            pass
    return list(latest.values())


def read_reports(
    reports: ContactReports, side: Side, start_s: float, rate_hz: float, latest: dict[int, GaitEvent]
) -> Iterator[tuple[int, bool, GaitEvent]]:
    """Yield sample at which an event is reported, whether the report is final, and the event.

    Parameters
    ----------
    start_s : time of sample 0. latest : number → event as last reported, including earlier blocks; updated in
        place. Only the last few events can be reported again.
    """
    for kind, number, detection, last, sample, uncertainty in zip(*reports, strict=True):
        first = latest.get(int(number))
        event = GaitEvent(
            time_s=start_s + float(sample) / rate_hz,
            side=side,
            kind=KINDS[kind],
            source=SOURCE,
            detected_s=start_s + int(detection) / rate_hz if first is None else first.detected_s,
            uncertainty_s=float(uncertainty),
            first_s=None if first is None else first.time_s,
        )
        latest[int(number)] = event
        yield int(detection), bool(last), event


def detect(orientations: Orientations, params: FootPitchParams | None = None) -> GaitEvents:
    """Contacts of each foot by the published foot-pitch rule; otherwise as `detect_contacts`."""
    rule = params or FootPitchParams()

    def find(side: Side) -> tuple[list[GaitEvent], bool]:
        s, valid = pitch_signal(orientations.q[FOOT[side]]), orientations.valid[FOOT[side]]
        return _pitch_events(side, s, valid, orientations, rule), False

    return _each_foot(orientations, rule, find)


def _each_foot(
    orientations: Orientations,
    params: FootPitchParams,
    find: Callable[[Side], tuple[list[GaitEvent], bool]],
) -> GaitEvents:
    """Apply `find` to every usable foot, and collect notices.

    Parameters
    ----------
    find : side → its contacts, and whether they come from displacement.
    """
    if orientations.rate_hz < params.min_rate_hz:
        raise SignalError(
            "sample_rate_too_low",
            Message(
                "Gait events need at least {min_rate_hz:g} Hz, the recording has {rate_hz:g} Hz. "
                "Record at a higher rate.",
                min_rate_hz=params.min_rate_hz,
                rate_hz=orientations.rate_hz,
            ),
        )
    events: list[GaitEvent] = []
    notices: list[Notice] = []
    figures: dict[str, PitchFigures] = {}
    for side in SIDES:
        foot = FOOT[side]
        if foot not in orientations.q or not orientations.valid[foot].any():
            message = Message(
                "No sensor on the {side} foot, or no sample of it: its contacts are unknown.", side=side
            )
            notices.append(Notice("foot_missing", message, foot))
            continue
        no_rest = [n for n in orientations.notices if n.code == "no_rest" and n.sensor in (None, foot)]
        if no_rest:
            # without rest the foot's attitude means nothing, and so does the zero of its pitch
            notices.extend(n for n in no_rest if n not in notices)
            continue
        s, valid = pitch_signal(orientations.q[foot]), orientations.valid[foot]
        contacts, by_way = find(side)
        events.extend(contacts)
        figures[foot] = PitchFigures(
            s_min=float(s[valid].min(initial=1.0)),
            s_max=float(s[valid].max(initial=-1.0)),
            s_quiet=_quiet_level(orientations.q[foot], s, valid, orientations.rate_hz, params),
            s_flat=_flat_level(contacts, s, valid, orientations),
            n_ic=sum(e.kind == "ic" for e in contacts),
            n_tc=sum(e.kind == "tc" for e in contacts),
        )
        notices.extend(_remarks(side, figures[foot], params, by_way=by_way))
    if params.threshold != FootPitchParams.threshold and figures:
        notices.append(_threshold_notice(figures, params))
    events.sort(key=lambda e: (e.time_s, e.side, e.kind))
    return GaitEvents(tuple(events), tuple(notices), figures)


def _pitch_events(
    side: Side, s: Floats, valid: Bools, orientations: Orientations, params: FootPitchParams
) -> list[GaitEvent]:
    """Apply the rule to one foot over the whole recording."""
    kind, index, detections, offset = advance_foot_pitch(
        FootPitchState.start(orientations.rate_hz, params), s, valid
    )
    step = 1.0 / orientations.rate_hz
    return [
        GaitEvent(
            time_s=float(orientations.t_s[j] + o * step),
            side=side,
            kind=KINDS[k],
            source=PITCH_RULE,
            detected_s=float(orientations.t_s[detection]),
        )
        for k, j, detection, o in zip(kind, index, detections, offset, strict=True)
    ]


def _quiet_level(q: Floats, s: Floats, valid: Bools, rate_hz: float, params: FootPitchParams) -> float | None:
    """Mean s over the quiet seconds of a foot, None without any."""
    second = max(2, round(rate_hz))
    whole = len(s) // second
    if whole == 0:
        return None
    speed = np.append(compare_neighbours(q, angle_between) * rate_hz, 0.0)
    seconds = (whole, second)
    quiet = speed[: whole * second].reshape(seconds).mean(axis=1) < params.quiet_rad_s
    quiet &= valid[: whole * second].reshape(seconds).all(axis=1)
    return float(s[: whole * second].reshape(seconds)[quiet].mean()) if quiet.any() else None


def _flat_level(events: list[GaitEvent], s: Floats, valid: Bools, orientations: Orientations) -> float | None:
    """Median over the stances of a foot of the mean s in their middle thirds, None without a complete
    stance.
    """
    ordered = sorted(events, key=lambda e: e.time_s)
    stances = [
        (contact.time_s, off.time_s - contact.time_s)
        for contact, off in pairwise(ordered)
        if (contact.kind, off.kind) == ("ic", "tc")
    ]
    if not stances:
        return None
    start, lasts = np.array(stances).T
    first, last = (np.searchsorted(orientations.t_s, start + x) for x in (lasts / 3.0, 2.0 * lasts / 3.0))
    lost = np.concatenate(([0], np.cumsum(~valid)))
    whole = (last > first) & (lost[first] == lost[last])
    middles = [s[a:b].mean() for a, b in zip(first[whole].tolist(), last[whole].tolist(), strict=True)]
    return float(np.median(middles)) if middles else None


def _remarks(side: Side, figures: PitchFigures, params: FootPitchParams, *, by_way: bool) -> list[Notice]:
    """Notices on why the events of one foot are missing or doubtful."""
    foot = FOOT[side]
    remarks = []
    if by_way:
        remarks.append(
            Notice(
                "contacts_by_way",
                Message(
                    "The pitch of the {side} foot does not show its contacts, as in shuffling or dragging. "
                    "They were detected from its displacement: {n_ic} initial contacts, to about ± 0.05 s.",
                    side=side,
                    n_ic=figures.n_ic,
                ),
                foot,
                severity="info",
            )
        )
    elif figures.s_min >= params.threshold:
        remarks.append(
            Notice(
                "no_toe_off",
                Message(
                    "The pitch of the {side} foot never fell below {threshold} (lowest: {s_min}), so "
                    "no contacts "
                    "were detected. Possible causes: shuffling gait, no walking, or a sensor on "
                    "another segment.",
                    side=side,
                    threshold=_degrees(params.threshold),
                    s_min=_degrees(figures.s_min),
                ),
                foot,
            )
        )
    elif figures.s_max < params.suspect_max and not _stood_as_in_stance(figures, params):
        remarks.append(
            Notice(
                "rest_pose_suspect",
                Message(
                    "The pitch of the {side} foot never exceeded {suspect_max} (highest: {s_max}). "
                    "Check that the person stood with the whole sole on the floor.",
                    side=side,
                    suspect_max=_degrees(params.suspect_max),
                    s_max=_degrees(figures.s_max),
                ),
                foot,
            )
        )
    if figures.s_quiet is not None and abs(figures.s_quiet) > params.suspect_quiet:
        remarks.append(
            Notice(
                "rest_pose_suspect",
                Message(
                    "The mean pitch of the {side} foot at rest is {s_quiet} (expected within "
                    "±{suspect_quiet}). Check that the person stood with the whole sole on the floor.",
                    side=side,
                    s_quiet=_degrees(figures.s_quiet),
                    suspect_quiet=_degrees(params.suspect_quiet),
                ),
                foot,
            )
        )
    return remarks


def _stood_as_in_stance(figures: PitchFigures, params: FootPitchParams) -> bool:
    """Whether the pitch of a foot at rest equals that in mid-stance: a foot that drops, or hardly lifts
    its toes.
    """
    return figures.s_flat is not None and abs(figures.s_flat) <= params.suspect_quiet


def _threshold_notice(figures: dict[str, PitchFigures], params: FootPitchParams) -> Notice:
    """Notice with the counts of both feet if the threshold is not the published one."""
    counts = ", ".join(f"{foot} {f.n_ic} initial contacts" for foot, f in figures.items())
    return Notice(
        "event_threshold_changed",
        Message(
            "Contacts were detected with a push-off threshold of {threshold:g} instead of "
            "{threshold2:g}: {counts}. Compare both feet: a higher threshold can miss most contacts of a "
            "drop foot.",
            threshold=params.threshold,
            threshold2=FootPitchParams.threshold,
            counts=counts,
        ),
    )


def _degrees(s: float) -> str:
    """Pitch for a value of s, formatted for display."""
    return f"{np.degrees(np.arcsin(np.clip(s, -1.0, 1.0))):.1f}°".replace("-", "−")
