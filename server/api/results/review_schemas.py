"""Schemas of reviews: edits, current events and strides, signals."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from sagittal.server.api.schemas import Line, Request

Seconds = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False, description="s from the start")]

AnySeconds = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False, description="s from the start")]
"""Also before the recording: such times are rejected with a message of the review rather than of the form."""


class EditNew(Request):
    """A change of an event (move, add, delete) or the exclusion or inclusion of a stride."""

    kind: Literal["move_event", "add_event", "delete_event", "exclude_stride", "include_stride"]
    side: Literal["left", "right"]
    time_s: Seconds = Field(description="of the event, or a moment inside the stride")
    event: Literal["ic", "tc"] | None = Field(default=None, description="contact or foot-off; events only")
    to_s: AnySeconds | None = Field(default=None, description="where the event is moved")
    reason: Line | None = Field(default=None, description="why a stride is left out")


@dataclass(frozen=True)
class EditAnswer:
    """An edit in effect, with author and time."""

    seq: int
    by: str | None
    at: dt.datetime
    kind: str
    side: str
    time_s: float
    event: str | None = None
    to_s: float | None = None
    reason: str | None = None


@dataclass(frozen=True)
class Event:
    """A contact (ic) or foot-off (tc); its source is a detector, "consensus", or "manual".

    `confidence` is the fraction of detectors that found it, null with only one; `uncertainty_s` is the
    standard uncertainty of its time, null if placed manually.
    """

    side: str
    kind: str
    time_s: float
    source: str
    confidence: float | None
    uncertainty_s: float | None


@dataclass(frozen=True)
class ReviewedStride:
    """A stride with the findings of the rules, and whether and why it is excluded."""

    side: str
    start_s: float
    tc_s: float | None
    end_s: float
    flags: list[str]
    excluded_by: Literal["rule", "person"] | None
    excluded: str | None


@dataclass(frozen=True)
class Review:
    """Current events, strides and parameters of an analysis.

    `version` increases with every change; `redoable` is the number of undone edits that can be redone.
    """

    analysis_id: str
    editable: bool
    version: int
    redoable: int
    edits: list[EditAnswer]
    events: list[Event]
    strides: list[ReviewedStride]
    parameters: list[dict[str, Any]]
