"""Hourly and daily totals of a daily-life recording, by the device's clock if available."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.activity.result import (
    KINDS,
    TRANSITIONS,
    ActivityBout,
    ActivityDay,
    ActivityHour,
    ActivityKind,
    ActivitySpan,
    PosturalTransition,
)
from sagittal.core.frames import Floats

HOUR_S: Final = 3600.0
DAY_S: Final = 86400.0


def sum_hours(
    duration_s: float, started_at: dt.datetime | None, spans: Sequence[ActivitySpan], steps_s: Floats
) -> tuple[ActivityHour, ...]:
    """Steps and minutes for every hour that the recording overlaps."""
    edges = _edges(duration_s, HOUR_S, _since(started_at, HOUR_S))
    minutes = _minutes(edges, spans)
    counts = np.histogram(steps_s, edges)[0]
    return tuple(
        ActivityHour(edges[i], edges[i + 1], int(counts[i]), minutes[i]) for i in range(len(edges) - 1)
    )


def sum_days(
    duration_s: float,
    started_at: dt.datetime | None,
    spans: Sequence[ActivitySpan],
    steps_s: Floats,
    bouts: Sequence[ActivityBout],
    transitions: Sequence[PosturalTransition],
) -> tuple[ActivityDay, ...]:
    """Steps and minutes for every day, from midnight to midnight, or of 24 h without a clock."""
    edges = _edges(duration_s, DAY_S, _since(started_at, DAY_S))
    minutes = _minutes(edges, spans)
    counts = np.histogram(steps_s, edges)[0]
    days = []
    for i, (a, b) in enumerate(pairwise(edges)):
        own = [x for x in bouts if a <= x.start_s < b]
        kinds = Counter(t.kind for t in transitions if a <= t.time_s < b)
        absent = minutes[i]["non_wear"] + minutes[i]["gap"]
        days.append(
            ActivityDay(
                date=None if started_at is None else (started_at + dt.timedelta(seconds=a + 1e-3)).date(),
                start_s=a,
                end_s=b,
                worn_h=max(0.0, (b - a) / HOUR_S - absent / 60.0),
                steps=int(counts[i]),
                minutes=minutes[i],
                transitions={kind: kinds[kind] for kind in TRANSITIONS},
                bouts=len(own),
                longest_bout_s=max((x.duration_s for x in own), default=None),
            )
        )
    return tuple(days)


def _since(started_at: dt.datetime | None, length_s: float) -> float:
    """Time from the last full hour or midnight to the first sample, s."""
    if started_at is None:
        return 0.0
    midnight = started_at.replace(hour=0, minute=0, second=0, microsecond=0)
    return (started_at - midnight).total_seconds() % length_s


def _edges(duration_s: float, length_s: float, since_s: float) -> list[float]:
    inner = np.arange(length_s - since_s, duration_s, length_s)
    return [0.0, *(float(x) for x in inner if x > 0.0), duration_s]


def _minutes(edges: Sequence[float], spans: Sequence[ActivitySpan]) -> list[dict[ActivityKind, float]]:
    """Minutes of each kind between successive edges."""
    sums: list[dict[ActivityKind, float]] = [dict.fromkeys(KINDS, 0.0) for _ in edges[1:]]
    i = 0
    for span in spans:
        while i + 1 < len(sums) and edges[i + 1] <= span.start_s:
            i += 1
        k, cursor_s = i, span.start_s
        while cursor_s < span.end_s:
            upto = span.end_s if k + 1 == len(sums) else min(span.end_s, edges[k + 1])
            sums[k][span.kind] += (upto - cursor_s) / 60.0
            cursor_s, k = upto, k + 1
    return sums
