"""Schemas of comparisons between visits."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Any, Literal

from sagittal.core.change import Change
from sagittal.core.subject.condition import Footwear, Orthosis, WalkingAid, WalkingPace
from sagittal.server.report.history.trends import TrendPoint


@dataclass(frozen=True)
class Condition:
    """Walking condition, as codes and in words; null = not recorded, or treadmill speed unknown."""

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
    """An analysed visit; `label` from the programme's plan, null outside one. With feedback: a training."""

    session_id: str
    performed_on: dt.date
    title: str
    label: str | None
    kind: Literal["assessment", "training"]
    condition: Condition


@dataclass(frozen=True)
class OtherWalksAnswer:
    """Visits with a different walking condition: their number, and the latest, to be requested with
    `like`.
    """

    condition: Condition
    count: int
    session_id: str


@dataclass(frozen=True)
class TrendLine:
    """One side; `base` and `latest` are indices of the first and last assessment, null without one."""

    side: str | None
    mdc: float | None
    mcid: float | None
    points: list[TrendPoint]
    base: int | None
    latest: int | None
    words: str | None


@dataclass(frozen=True)
class TrendAnswer:
    """A parameter over the visits, with the norm for comparable subjects."""

    name: str
    title: str
    unit: str
    norm: dict[str, Any] | None
    lines: list[TrendLine]


@dataclass(frozen=True)
class Trends:
    """Parameters over the visits with the same walking condition."""

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
    """A change and its assessment as shown on the pages."""

    words: str


@dataclass(frozen=True)
class Comparison:
    """Two sessions, the earlier one first; `cautions` list differences in condition and measurement.

    `comparable` false: the walking conditions differ or feedback was given, so changes are not assessed.
    """

    before: ComparedSession
    after: ComparedSession
    comparable: bool
    cautions: list[str]
    changes: list[ChangeInWords]
