"""What goes over the wire about biofeedback: prescriptions, targets, strides with and without feedback."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field, StringConstraints

from sagittal.server.api.schemas import HexId, Request, Side

# limits of the numbers are those of sagittal.core.feedback.Prescription; its errors say what was expected
Number = Annotated[float, Field(allow_inf_nan=False)]
Source = Literal["norm", "own_better_side", "own_baseline", "manual"]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9_]{1,64}$")]


class TargetNew(Request):
    """Where the value should be; mean and sd are entered for `manual` only, the others are looked up."""

    source: Source = "norm"
    mean: Number | None = None
    sd: Number | None = None
    words: str = Field(
        default="", max_length=500, description="written anew, so that a record can be sent back"
    )
    session_id: HexId | None = Field(default=None, description="of own_*; null = the newest analysed walk")


class ScheduleNew(Request):
    """Which strides get feedback."""

    kind: Literal["every", "fading"] = "fading"
    shares_pct: Annotated[list[int], Field(max_length=20)] = Field(default=[100, 50, 0])
    strides_per_share: int = 60
    probe_every: int | None = 40
    probe_strides: int = 10
    retention_strides: int = 20


class ProgressionNew(Request):
    """When it gets harder or easier; one level is `sd_per_level` sd of the target."""

    automatic: bool = True
    window: int = 20
    share: Number = 0.7
    away_share: Number = 0.5
    sd_per_level: Number = 1.0
    start_level: int | None = None
    worse: Literal["low", "high"] | None = None


class StopRuleNew(Request):
    """When feedback ends by itself; null = never for this reason."""

    max_strides: int | None = None
    max_minutes: Number | None = 15.0
    gps_rise_deg: Number | None = 3.2


class GuardNew(Request):
    """From which change beside the target on the therapist is told."""

    other_change: Number | None = None
    gps_rise_deg: Number | None = 1.6


class PrescriptionNew(Request):
    """Feedback on one parameter of one side; members left out have their defaults."""

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
    """A prescription; it never changes: another one ends it."""

    id: str
    patient_id: str
    content: dict[str, Any]
    words: list[str]
    created_at: dt.datetime
    by: str | None
    ended_at: dt.datetime | None


@dataclass(frozen=True)
class TargetOffer:
    """What a source gives as target for this person; null with a reason where it gives nothing."""

    source: Source
    mean: float | None
    sd: float | None
    words: str | None
    reason: str | None


@dataclass(frozen=True)
class Feedback:
    """Strides with and without feedback of a session's live take; empty with a reason where there is none."""

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
