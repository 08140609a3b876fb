"""Schemas of live trials; the messages of the feed are documented in docs/reference/api.md."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from sagittal.server.api.schemas import HexId, Request
from sagittal.server.live.take import TherapistMark


@dataclass(frozen=True)
class OpenedTake:
    """A live trial waiting for a tablet, with its code, which is shown only once."""

    id: str
    session_id: str
    state: str
    code: Annotated[str, Field(description="six characters, to be shown in two groups of three")]
    expires_at: dt.datetime


@dataclass(frozen=True)
class TakeAnswer:
    """A live trial.

    `state` is pairing, open (a tablet has joined), streaming, finished (by the tablet) or closed (here);
    `problem` finish_mismatch: the tablet's final count or hash differs. node_away: the web server that runs
    the trial is unavailable.
    """

    id: str
    session_id: str
    state: str
    source: str | None
    count: Annotated[int | None, Field(description="batches, at the end")]
    recording_id: Annotated[str | None, Field(description="what the take became, null until then")]
    problem: str | None
    code_expires_at: dt.datetime | None
    created_at: dt.datetime
    finished_at: dt.datetime | None


@dataclass(frozen=True)
class LiveSensor:
    """A sensor as listed by the recorder; in frames, with the statistics of the estimator."""

    id: str
    segment: str | None
    rate_hz: float
    lost_pct: Annotated[float | None, Field(description="null: only an estimator counts")]
    still: bool | None
    battery_pct: float | None
    state: Annotated[str, Field(description="ok, warn, bad, none")]
    words: str


@dataclass(frozen=True)
class LiveState:
    """State of a session's latest live trial: the feed's `state` message."""

    type: Literal["state"]
    take: Annotated[str | None, Field(description="null: there was none yet")]
    state: Annotated[str, Field(description="none, pairing, open, streaming, finished or closed")]
    tablet: Annotated[str, Field(description="connected, lost, or none (not joined, or the take is over)")]
    source: str | None
    count: Annotated[int | None, Field(description="batches so far")]
    elapsed_s: Annotated[float | None, Field(description="length of what has come, estimated or not")]
    sensors: Annotated[
        list[LiveSensor], Field(description="empty until a tablet has joined and once the take is over")
    ]
    marks: list[TherapistMark]
    ghost: str | None
    stale: bool
    stopping: bool
    estimate: Annotated[str, Field(description="preparing, ok, failed, or none (nobody estimates)")]
    recording: str | None
    problem: str | None


class PairingCode(Request):
    """The code on the therapist's screen; case, spaces and hyphens are ignored."""

    code: Annotated[str, StringConstraints(min_length=1, max_length=40)]


class FilmBeginning(Request):
    """Start of a video on a tablet.

    `began_us` is the time of the first frame by the clock that stamps `sent_us` of its batches; `consent`
    confirms that the patient agreed to be filmed.
    """

    consent: bool
    began_us: Annotated[int, Field(ge=0, lt=1 << 53)]


@dataclass(frozen=True)
class EndedFilm:
    """Outcome of a video: whether it is attached to the trial."""

    kept: bool


@dataclass(frozen=True)
class PairedTablet:
    """Connection data for the tablet; the token is valid for this trial only, for twelve hours.

    `remembered` maps serial numbers of the clinic's sensors to their last segments.
    """

    token: str
    take: HexId
    session_title: str
    patient_code: str
    remembered: dict[str, str]
    socket: str


class LiveCommand(Request):
    """A command; feedback and pause take true or false, level takes steps (+ easier), mark and ghost a text.

    test takes "go", "repeat", or start and end of the functional test.
    """

    command: Literal[
        "start",
        "stop",
        "mark",
        "undo_mark",
        "feedback",
        "level",
        "pause",
        "redo_calibration",
        "ghost",
        "test",
    ]
    value: bool | int | Annotated[str, StringConstraints(max_length=200)] | dict[str, float] | None = None
    t_s: float | None = Field(
        None, ge=0, description="of a mark: the moment meant, in the time of the frames; null: the newest"
    )
