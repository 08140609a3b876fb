"""What goes over the wire about visits compared with each other."""

from __future__ import annotations

import datetime as dt
from typing import Any, Literal

from core.condition import Footwear, Orthosis, WalkingAid, WalkingPace
from server.api.schemas import Response


class Condition(Response):
    """How a take was walked, and the same in words; null = not stated, of a belt not entered."""

    protocol: str
    belt_speed_mps: float | None
    pace: WalkingPace | None
    aid: WalkingAid | None
    orthosis: Orthosis | None
    shoes: Footwear | None
    feedback: bool
    words: str


class TrendVisit(Response):
    """An analysed visit; `label` of the programme's plan, null outside one. With feedback: a training."""

    session_id: str
    performed_on: dt.date
    title: str
    label: str | None
    kind: Literal["assessment", "training"]
    condition: Condition


class OtherWalks(Response):
    """Visits walked otherwise: how many, and the newest of them, to be asked for with `like`."""

    condition: Condition
    count: int
    session_id: str


class Change(Response):
    """One figure in two sessions; beyond `limit` (MDC) the change is real, beyond `mcid` relevant too."""

    name: str
    side: str | None
    unit: str
    before: float | None
    after: float | None
    difference: float | None
    verdict: Literal["within_measurement_error", "real_change", "clinically_relevant"] | None
    limit: float | None
    limit_source: str | None
    people: str | None
    mcid: float | None
    mcid_source: str | None
    towards_norm: bool | None
    reason: str | None
    note: str | None


class TrendPoint(Response):
    """A value at a visit (index into `visits`); `change` from the first assessment, null with feedback."""

    visit: int
    value: float
    sd: float | None
    n: int
    ci_low: float | None
    ci_high: float | None
    change: Change | None


class TrendLine(Response):
    """One side; `base` and `latest` are indices of the first and the last assessment, null without one."""

    side: str | None
    mdc: float | None
    mcid: float | None
    points: list[TrendPoint]
    base: int | None
    latest: int | None
    words: str | None


class Trend(Response):
    """A figure over the visits, with the norm of people like this one."""

    name: str
    title: str
    unit: str
    norm: dict[str, Any] | None
    lines: list[TrendLine]


class Trends(Response):
    """Figures over the visits walked under one condition."""

    protocol: str | None
    condition: Condition | None
    visits: list[TrendVisit]
    others: list[OtherWalks]
    trends: list[Trend]


class ComparedSession(Response):
    """One of two sessions."""

    session_id: str
    performed_on: dt.date
    title: str
    protocol: str
    condition: Condition
    analysis_id: str


class ChangeInWords(Change):
    """A change and its verdict as the pages say it."""

    words: str


class Comparison(Response):
    """Two sessions, the earlier one first; `cautions` say how walks and measurements themselves differ.

    `comparable` false: they were not walked alike, or with feedback, and no change has a verdict.
    """

    before: ComparedSession
    after: ComparedSession
    comparable: bool
    cautions: list[str]
    changes: list[ChangeInWords]
