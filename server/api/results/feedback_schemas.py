"""Schemas of biofeedback: prescriptions, targets, strides with and without feedback."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field, StringConstraints

from sagittal.server.api.schemas import HexId, Request, Side

# numeric limits are checked by sagittal.core.feedback.Prescription, whose errors state the valid range
Number = Annotated[float, Field(allow_inf_nan=False)]
Source = Literal["norm", "own_better_side", "own_baseline", "manual"]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9_]{1,64}$")]


class TargetNew(Request):
    """Target value; mean and sd are entered for `manual` only and looked up otherwise."""

    source: Source = "norm"
    mean: Number | None = None
    sd: Number | None = None
    words: str = Field(
        default="", max_length=500, description="written anew, so that a record can be sent back"
    )
    session_id: HexId | None = Field(default=None, description="of own_*; null = the newest analysed walk")


class ScheduleNew(Request):
    """Schedule of strides with feedback."""

    kind: Literal["every", "fading"] = "fading"
    shares_pct: Annotated[list[int], Field(max_length=20)] = Field(default=[100, 50, 0])
    strides_per_share: int = 60
    probe_every: int | None = 40
    probe_strides: int = 10
    retention_strides: int = 20


class ProgressionNew(Request):
    """Rules for increasing or decreasing difficulty; one level is `sd_per_level` sd of the target."""

    automatic: bool = True
    window: int = 20
    share: Number = 0.7
    away_share: Number = 0.5
    sd_per_level: Number = 1.0
    start_level: int | None = None
    worse: Literal["low", "high"] | None = None


class StopRuleNew(Request):
    """Limits at which feedback ends automatically; null = no limit."""

    max_strides: int | None = None
    max_minutes: Number | None = 15.0
    gps_rise_deg: Number | None = 3.2


class GuardNew(Request):
    """Side effects: changes in other parameters at which the therapist is notified."""

    other_change: Number | None = None
    gps_rise_deg: Number | None = 1.6


class PrescriptionNew(Request):
    """Feedback on one parameter of one side; omitted fields have their defaults."""

    parameter: Name
    side: Side | None = None
    target: TargetNew = TargetNew()
    band_sd: Number = 1.0
    modes: Annotated[list[Literal["bar", "zone", "tone", "tick"]], Field(max_length=8)] = Field(
        default=["bar"]
    )
    positive_only: bool = False
    bandwidth: bool = False
    schedule: ScheduleNew = ScheduleNew()
    progression: ProgressionNew = ProgressionNew()
    stop_rule: StopRuleNew = StopRuleNew()
    guard: GuardNew = GuardNew()


@dataclass(frozen=True)
class PrescriptionAnswer:
    """A prescription; immutable, and ended by the next one."""

    id: str
    patient_id: str
    content: dict[str, Any]
    words: list[str]
    created_at: dt.datetime
    by: str | None
    ended_at: dt.datetime | None


@dataclass(frozen=True)
class TargetOffer:
    """Target from one source for this patient; null with a reason if unavailable."""

    source: Source
    mean: float | None
    sd: float | None
    words: str | None
    reason: str | None


@dataclass(frozen=True)
class Feedback:
    """Strides with and without feedback of a session's live trial; empty with a reason if there are none."""

    reason: str | None = None
    prescription: dict[str, Any] | None = None
    words: list[str] = field(default_factory=list)
    parameter: str | None = None
    unit: str | None = None
    side: str | None = None
    rows: list[dict[str, Any]] = field(default_factory=list)
    probes: list[dict[str, Any]] = field(default_factory=list)
    levels: list[dict[str, Any]] = field(default_factory=list)
    effects: list[dict[str, Any]] = field(default_factory=list)
    retention: dict[str, Any] | None = None
    notes: list[str] = field(default_factory=list)
    strides: list[dict[str, Any]] = field(default_factory=list)
