"""What goes over the wire about live takes; the feed's messages are in docs/reference/api.md."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from sagittal.server.api.schemas import HexId, Request
from sagittal.server.live.take import TherapistMark


@dataclass(frozen=True)
class OpenedTake:
    """A take that waits for a tablet, and its code; the code is told this once."""

    id: str
    session_id: str
    state: str
    code: Annotated[str, Field(description="six characters, to be shown in two groups of three")]
    expires_at: dt.datetime


@dataclass(frozen=True)
class TakeAnswer:
    """A live take.

    `state` is pairing, open (a tablet has joined), streaming, finished (by the tablet) or closed (here);
    `problem` finish_mismatch: the tablet counted or hashed otherwise at the end. node_away: the web
    server that has the take is away.
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
    """A sensor as the recorder knows it; frames have it with what the estimator counts."""

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
    """Where a session's newest take stands: the feed's `state` message."""

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
    """The code on the therapist's screen, in any case, spaces and hyphens do not count."""

    code: Annotated[str, StringConstraints(min_length=1, max_length=40)]


class FilmBeginning(Request):
    """A tablet begins to film.

    `began_us` is the first picture's time by the clock that stamps `sent_us` of its batches; `consent`, that
    the person agreed to be filmed.
    """

    consent: bool
    began_us: Annotated[int, Field(ge=0, lt=1 << 53)]


@dataclass(frozen=True)
class EndedFilm:
    """What became of a film: whether it stands beside the take."""

    kept: bool


@dataclass(frozen=True)
class PairedTablet:
    """What the tablet needs to stream; the token opens this take only, for twelve hours.

    `remembered` has the serial numbers of the clinic's sensors with the segment each was worn on last.
    """

    token: str
    take: HexId
    session_title: str
    patient_code: str
    remembered: dict[str, str]
    socket: str


class LiveCommand(Request):
    """A command; feedback and pause take true or false, level steps (+ easier), mark and ghost a text.

    test takes "go", "repeat", or when the functional test began and ended."""

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
