"""View of a daily-life recording: days, hours, transitions, walking bouts and trunk inclination.

For the results see core/activity/result.py, for the charts server/report/view/daily_charts.py, for names of
activities and days server/report/words/daily_words.py.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.activity.parameters import WORN_H
from sagittal.core.activity.result import (
    KINDS,
    TRANSITIONS,
    ActivityBout,
    ActivityDay,
    ActivityKind,
    ActivityResult,
    PosturalTransition,
    TransitionCandidate,
    TransitionKind,
)
from sagittal.core.frames import Floats
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.server.report.words.daily_words import (
    DASH,
    DAY_S,
    KIND_LABELS,
    REFUSALS,
    TOTALS,
    TRANSITION_LABELS,
    clock_label,
    day_label,
    find_day_label,
    find_midnight,
    format_hours,
)
from sagittal.server.report.words.wording import format_number

BIN_EDGES_S: Final = (10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0)
"""Limits of the bins of walking bouts, s; the last bin is open."""

EVENTS_SHOWN: Final = 300
"""Rows in the page's list of transitions; the file contains all."""

COURSE_S: Final = 600
"""Window length for drawing inclination, s."""


@dataclass(frozen=True)
class DayTotals:
    """One day in words.

    Parameters
    ----------
    label : date, or "Day 2" without a clock. part : recorded part, empty for the whole day.
    midnight_s : start of its ribbon, relative to the first sample. times : column of TOTALS → h:min.
    counted : wear time is sufficient for the means.
    """

    label: str
    part: str
    midnight_s: float
    start_s: float
    end_s: float
    worn: str
    times: Mapping[str, str]
    steps: str
    bouts: str
    longest: str
    counted: bool


@dataclass(frozen=True)
class HourTotals:
    """One hour in words; `times` : minutes by column of TOTALS."""

    day: str
    label: str
    steps: int
    times: Mapping[str, str]


@dataclass(frozen=True)
class TransitionTotals:
    """One kind of transition: count per day, and size."""

    label: str
    per_day: tuple[int, ...]
    total: int
    lean: str
    rise: str
    inconsistent: int


@dataclass(frozen=True)
class TransitionEvent:
    """A transition, or a rejected forward lean with the reason."""

    when: str
    label: str
    lean: str
    rise: str
    status: str
    counts: bool


@dataclass(frozen=True)
class BoutBin:
    """Walking bouts of one range of length."""

    label: str
    bouts: int
    steps: int
    minutes: float
    cadence: str


@dataclass(frozen=True)
class LeanRow:
    """Trunk inclination during one activity, in whole degrees, positive forward."""

    label: str
    hours: str
    median: str
    low: str
    high: str


@dataclass(frozen=True, eq=False)
class DailyLifeView:
    """Content of the daily-life page and week report.

    Parameters
    ----------
    found : the underlying result. place : sensor placement.
    has_clock : days and hours follow the device's clock, otherwise counted from the first sample.
    columns : totals with data. mean : of days with sufficient wear time, None if there are none.
    events : the first transitions and candidates in order of time, of `events_total`.
    lean_reason : why inclination is unknown, None if known.
    """

    found: ActivityResult
    place: str
    has_clock: bool
    columns: tuple[str, ...]
    days: tuple[DayTotals, ...]
    mean: DayTotals | None
    hours: tuple[HourTotals, ...]
    transitions: tuple[TransitionTotals, ...]
    events: tuple[TransitionEvent, ...]
    events_total: int
    bins: tuple[BoutBin, ...]
    stairs_steps: tuple[int, int]
    leans: tuple[LeanRow, ...]
    lean_reason: str | None

    def to_json(self) -> dict[str, object]:
        """Content of the report's JSON; spans, steps and inclination have separate files."""
        return {
            "segment": self.found.segment,
            "started_at": None if self.found.started_at is None else self.found.started_at.isoformat(),
            "days": self.found.days,
            "bouts": self.bins,
            "inclination": self.leans,
            "sub_threshold": len(self.found.sub_threshold),
        }


def daily_life_view(activity: ActivityResult | None) -> DailyLifeView | None:
    """View of a daily-life recording; None for other trials."""
    if activity is None:
        return None
    days = tuple(_describe_day(activity, i, d) for i, d in enumerate(activity.days))
    active = tuple(
        c for c, kinds in TOTALS.items() if c != "Not recorded" or any(activity.minutes(k) for k in kinds)
    )
    events: list[PosturalTransition | TransitionCandidate] = [*activity.transitions, *activity.candidates]
    events.sort(key=lambda e: e.time_s)
    leans = _describe_leans(activity)
    return DailyLifeView(
        found=activity,
        place="chest" if activity.segment == "chest" else "lower back",
        has_clock=activity.started_at is not None,
        columns=active,
        days=days,
        mean=_average(activity.days),
        hours=tuple(
            HourTotals(
                find_day_label(activity, h.start_s),
                clock_label(activity, h.start_s),
                h.steps,
                {c: format_number(_sum(h.minutes, TOTALS[c]), 0) for c in active},
            )
            for h in activity.hours
        ),
        transitions=tuple(_count_transitions(activity, kind) for kind in TRANSITIONS),
        events=tuple(_describe_event(activity, e) for e in events[:EVENTS_SHOWN]),
        events_total=len(events),
        bins=bin_bouts(activity.bouts),
        stairs_steps=(
            sum(b.stairs_up_steps for b in activity.bouts),
            sum(b.stairs_down_steps for b in activity.bouts),
        ),
        leans=leans,
        lean_reason=None if leans else "unknown: no trunk lean showed the forward direction",
    )


def bin_bouts(bouts: Sequence[ActivityBout]) -> tuple[BoutBin, ...]:
    """Group walking bouts by length."""
    ends = [*BIN_EDGES_S, np.inf]
    places = np.searchsorted(BIN_EDGES_S, [b.duration_s for b in bouts], "right")
    rows = []
    for i, end in enumerate(ends):
        own = [b for b, place in zip(bouts, places.tolist(), strict=True) if place == i]
        steps = sum(b.steps for b in own)
        rows.append(
            BoutBin(
                label=_bin_label(ends[i - 1] if i else 0.0, end),
                bouts=len(own),
                steps=steps,
                minutes=sum(b.duration_s for b in own) / 60.0,
                cadence=format_number(sum(b.cadence_spm * b.steps for b in own) / steps, 0)
                if steps
                else DASH,
            )
        )
    return tuple(rows)


def _bin_label(low: float, high: float) -> str:
    if not low:
        return Message("below {high:.0f}\u202fs", high=high)
    unit, size = ("s", 1.0) if low < 60.0 else ("min", 60.0)
    if np.isinf(high):
        return Message("{size:.0f}\u202f{unit} or longer", size=low / size, unit=unit)
    if low < 60.0 <= high:
        return f"{low:.0f}–{high:.0f}\u202fs"
    return f"{low / size:.0f}–{high / size:.0f}\u202f{unit}"


def _describe_day(activity: ActivityResult, i: int, d: ActivityDay) -> DayTotals:
    begins = f"{clock_label(activity, d.start_s)}–" if activity.started_at is not None else ""
    whole = d.end_s - d.start_s > DAY_S - 60.0
    ends = (
        clock_label(activity, d.end_s)
        if begins
        else Message("first {format_hours} h", format_hours=format_hours((d.end_s - d.start_s) / 60))
    )
    is_worn = d.worn_h > 0.0
    return DayTotals(
        label=day_label(i, d.date),
        part="" if whole else begins + (ends if ends != "00:00" else "24:00"),
        midnight_s=find_midnight(activity, d.start_s),
        start_s=d.start_s,
        end_s=d.end_s,
        worn=format_hours(60.0 * d.worn_h),
        times={c: format_hours(_sum(d.minutes, kinds)) for c, kinds in TOTALS.items()},
        steps=format_number(d.steps, 0) if is_worn else DASH,
        bouts=str(d.bouts) if is_worn else DASH,
        longest=DASH if d.longest_bout_s is None else format_number(d.longest_bout_s / 60.0, 1),
        counted=d.worn_h >= WORN_H,
    )


def _average(days: Sequence[ActivityDay]) -> DayTotals | None:
    """Mean of the days with sufficient wear time."""
    own = [d for d in days if d.worn_h >= WORN_H]
    if not own:
        return None
    n = len(own)
    longest = [d.longest_bout_s for d in own if d.longest_bout_s is not None]
    return DayTotals(
        label=Message(f"Mean of {{value}} {plural(n, 'day', 'days')}", value=n),
        part="",
        midnight_s=0.0,
        start_s=0.0,
        end_s=0.0,
        worn=format_hours(60.0 * sum(d.worn_h for d in own) / n),
        times={c: format_hours(sum(_sum(d.minutes, k) for d in own) / n) for c, k in TOTALS.items()},
        steps=format_number(sum(d.steps for d in own) / n, 0),
        bouts=format_number(sum(d.bouts for d in own) / n, 0),
        longest=format_number(sum(longest) / len(longest) / 60.0, 1) if longest else DASH,
        counted=True,
    )


def _sum(minutes: Mapping[ActivityKind, float], kinds: Sequence[ActivityKind]) -> float:
    return sum(minutes.get(kind, 0.0) for kind in kinds)


def _count_transitions(activity: ActivityResult, kind: TransitionKind) -> TransitionTotals:
    own = [t for t in activity.transitions if t.kind == kind]
    rises = [abs(t.rise_m) for t in own if t.rise_m is not None]
    return TransitionTotals(
        label=TRANSITION_LABELS[kind],
        per_day=tuple(d.transitions.get(kind, 0) for d in activity.days),
        total=len(own),
        lean=format_number(float(np.median([t.lean_deg for t in own])), 0) if own else DASH,
        rise=format_number(float(np.median(rises)), 2) if rises else DASH,
        inconsistent=Counter(t.consistent for t in own)[False],
    )


def _describe_event(activity: ActivityResult, e: PosturalTransition | TransitionCandidate) -> TransitionEvent:
    when = f"{find_day_label(activity, e.time_s)} {clock_label(activity, e.time_s)}"
    lean = format_number(e.lean_deg, 0)
    rise = DASH if e.rise_m is None else format_number(e.rise_m, 2)
    if isinstance(e, TransitionCandidate):
        label = "" if e.likely is None else f"{TRANSITION_LABELS[e.likely]}?"
        return TransitionEvent(when, label or DASH, lean, rise, REFUSALS[e.refused], counts=False)
    status = "included" if e.consistent else "counted, but inconsistent with the preceding posture"
    return TransitionEvent(when, TRANSITION_LABELS[e.kind], lean, rise, status, counts=True)


def _describe_leans(activity: ActivityResult) -> tuple[LeanRow, ...]:
    """Median and central 90 % of inclination per activity; lying is excluded."""
    values, kinds = activity.inclination_deg, label_seconds(activity)
    rows = []
    for i, kind in enumerate(KINDS):
        own = values[kinds == i]
        own = own[np.isfinite(own)]
        if not len(own) or kind in {"lying", "unknown", "non_wear", "gap"}:
            continue
        low, median, high = (format_number(float(x), 0) for x in np.percentile(own, (5, 50, 95)))
        rows.append(LeanRow(KIND_LABELS[kind], format_hours(len(own) / 60.0), median, low, high))
    return tuple(rows)


def label_seconds(activity: ActivityResult) -> np.ndarray:
    """(seconds,) index into KINDS of the activity at the middle of every second."""
    seconds = np.arange(len(activity.inclination_deg)) + 0.5
    places = np.searchsorted([s.start_s for s in activity.spans], seconds, "right") - 1
    kinds = np.array([KINDS.index(s.kind) for s in activity.spans], dtype=np.intp)
    return kinds[np.maximum(places, 0)] if len(kinds) else np.full(len(seconds), KINDS.index("gap"))


def inclination_course(activity: ActivityResult, start_s: float, end_s: float) -> tuple[Floats, Floats]:
    """Inclination in windows of COURSE_S.

    Returns
    -------
    t_s : (n,) start of each window. course : (n, 3) 10 %, 50 % and 90 % of its seconds, NaN if fewer than a
        tenth of them are known.
    """
    first, last = int(start_s), min(int(np.ceil(end_s)), len(activity.inclination_deg))
    n = max(0, -(-(last - first) // COURSE_S))
    rows = np.full((n, COURSE_S), np.nan)
    rows.flat[: max(0, last - first)] = activity.inclination_deg[first:last]
    rows.sort(axis=1)
    finite = np.isfinite(rows).sum(axis=1)
    course = np.full((n, 3), np.nan)
    enough = finite * 10 >= COURSE_S
    for k, share in enumerate((0.1, 0.5, 0.9)):
        place = np.round(share * np.maximum(finite - 1, 0)).astype(np.intp)
        course[enough, k] = rows[np.arange(n), place][enough]
    return first + COURSE_S * np.arange(n, dtype=np.float64), course
