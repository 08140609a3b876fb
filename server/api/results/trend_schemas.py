"""What goes over the wire about visits compared with each other."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Any, Literal

from sagittal.core.change import Change
from sagittal.core.subject.condition import Footwear, Orthosis, WalkingAid, WalkingPace
from sagittal.server.report.history.trends import TrendPoint


@dataclass(frozen=True)
class Condition:
    """How a take was walked, and the same in words; null = not stated, of a belt not entered."""

    protocol: str
    belt_speed_mps: float | None
    pace: WalkingPace | None
    aid: WalkingAid | None
    orthosis: Orthosis | None
    shoes: Footwear | None
    feedback: bool
    words: str


@dataclass(frozen=True)
class TrendVisit:
    """An analysed visit; `label` of the programme's plan, null outside one. With feedback: a training."""

    session_id: str
    performed_on: dt.date
    title: str
    label: str | None
    kind: Literal["assessment", "training"]
    condition: Condition


@dataclass(frozen=True)
class OtherWalksAnswer:
    """Visits walked otherwise: how many, and the newest of them, to be asked for with `like`."""

    condition: Condition
    count: int
    session_id: str


@dataclass(frozen=True)
class TrendLine:
    """One side; `base` and `latest` are indices of the first and the last assessment, null without one."""

    side: str | None
    mdc: float | None
    mcid: float | None
    points: list[TrendPoint]
    base: int | None
    latest: int | None
    words: str | None


@dataclass(frozen=True)
class TrendAnswer:
    """A figure over the visits, with the norm of people like this one."""

    name: str
    title: str
    unit: str
    norm: dict[str, Any] | None
    lines: list[TrendLine]


@dataclass(frozen=True)
class Trends:
    """Figures over the visits walked under one condition."""

    protocol: str | None
    condition: Condition | None
    visits: list[TrendVisit]
    others: list[OtherWalksAnswer]
    trends: list[TrendAnswer]


@dataclass(frozen=True)
class ComparedSession:
    """One of two sessions."""

    session_id: str
    performed_on: dt.date
    title: str
    protocol: str
    condition: Condition
    analysis_id: str


@dataclass(frozen=True)
class ChangeInWords(Change):
    """A change and its verdict as the pages say it."""

    words: str


@dataclass(frozen=True)
class Comparison:
    """Two sessions, the earlier one first; `cautions` say how walks and measurements themselves differ.

    `comparable` false: they were not walked alike, or with feedback, and no change has a verdict.
    """

    before: ComparedSession
    after: ComparedSession
    comparable: bool
    cautions: list[str]
    changes: list[ChangeInWords]
