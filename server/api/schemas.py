"""What goes over the wire: every request and response of /api/v1."""

from __future__ import annotations

import datetime as dt
import json
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints

from core.condition import Footwear, Orthosis, WalkingAid, WalkingPace
from core.frames import Protocol
from server.auth.passwords import MAX_LENGTH, MIN_LENGTH
from server.auth.roles import Role

# one line of text: starts and ends with something visible, no control characters
_LINE = r"^[^\s\x00-\x1f\x7f]([^\x00-\x1f\x7f]*[^\s\x00-\x1f\x7f])?$"
Line = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=_LINE)]
Code = Annotated[str, StringConstraints(min_length=1, max_length=64, pattern=_LINE)]
SignInName = Annotated[
    str, StringConstraints(min_length=1, max_length=64, pattern=r"^[a-z0-9][a-z0-9._@-]*$")
]
Note = Annotated[str, StringConstraints(max_length=10_000)] | None
Password = Annotated[str, StringConstraints(min_length=MIN_LENGTH, max_length=MAX_LENGTH)]
Height = Annotated[float, Field(ge=0.5, le=2.5, allow_inf_nan=False, description="m")]
BirthYear = Annotated[int, Field(ge=1850, le=2200)]
Sex = Literal["female", "male"]
Side = Literal["left", "right"]
HexId = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{32}$")]


def _storable(value: dict[str, Any]) -> dict[str, Any]:
    # Python reads NaN and lone surrogates from JSON, but they are neither JSON nor UTF-8
    try:
        json.dumps(value, allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        raise ValueError("expected JSON with finite numbers and valid Unicode") from None
    return value


Json = Annotated[dict[str, Any], AfterValidator(_storable)]


class Request(BaseModel):
    """A body we receive: unknown members are refused, so a misspelt one is not silently ignored."""

    model_config = ConfigDict(extra="forbid")

    def values(self) -> dict[str, Any]:
        """Return the members that were sent; an empty note is stored as text."""
        sent = self.model_dump(exclude_unset=True)
        return sent | ({"note": ""} if "note" in sent and sent["note"] is None else {})


class Response(BaseModel):
    """A body we send, read from a row or a result."""

    model_config = ConfigDict(from_attributes=True)


class FieldProblem(Response):
    """One field that is not as expected."""

    field: str
    message: str


class ProblemDetails(Response):
    """RFC 9457; `code` is stable, `detail` is a sentence that says what to do."""

    type: str
    title: str
    status: int
    detail: str
    code: str
    errors: list[FieldProblem] | None = None


class SignIn(Request):
    """Name and password."""

    name: Annotated[str, StringConstraints(max_length=200)]
    password: Annotated[str, StringConstraints(max_length=1000)]
    next: str | None = Field(default=None, max_length=2000, description="page to go on to (forms)")


class SetUp(Request):
    """The first administrator."""

    name: SignInName
    display_name: Line | None = None
    password: Password


class PasswordChange(Request):
    """One's own new password."""

    current: Annotated[str, StringConstraints(max_length=1000)]
    password: Password


class User(Response):
    """An account."""

    id: str
    name: str
    display_name: str
    role: Role
    active: bool
    created_at: dt.datetime


class Account(Response):
    """Who is signed in, and what this person may do."""

    id: str
    name: str
    display_name: str
    role: Role
    actions: list[str]


class UserNew(Request):
    """A new account."""

    name: SignInName
    display_name: Line | None = None
    role: Role
    password: Password


class UserChange(Request):
    """What to change of an account; members left out stay as they are."""

    display_name: Line = ""
    role: Role = Role.VIEWER
    active: bool = True
    password: Password = ""


class PatientNew(Request):
    """A new patient, under the clinic's own pseudonym."""

    code: Code
    sex: Sex | None = None
    birth_year: BirthYear | None = None
    height_m: Height | None = None
    affected_side: Side | None = None
    is_control: bool = False
    note: Note = None


class PatientChange(PatientNew):
    """What to change of a patient; members left out stay as they are."""

    code: Code = ""


class Patient(Response):
    """A patient, with what a list shows of the visits."""

    id: str
    code: str
    sex: Sex | None
    birth_year: int | None
    height_m: float | None
    affected_side: Side | None
    is_control: bool
    note: str
    created_at: dt.datetime
    sessions: int
    last_visit: dt.date | None
    running: bool


class SessionNew(Request):
    """A new visit, today unless said otherwise; of how it was walked null = not stated."""

    title: Line = ""
    performed_on: dt.date = dt.date.min
    protocol: Protocol = "walk"
    height_m: Height | None = None
    pace: WalkingPace | None = None
    aid: WalkingAid | None = None
    orthosis: Orthosis | None = None
    shoes: Footwear | None = None
    feedback: bool = Field(default=False, description="biofeedback was given; a live take sets it by itself")
    note: Note = None


class SessionChange(SessionNew):
    """What to change of a session; members left out stay as they are."""


class PlannedSessionNew(SessionNew):
    """A new visit, perhaps one that was planned in a programme."""

    planned_visit_id: HexId | None = None


class ProgrammeNew(Request):
    """A programme for a patient; `starts_on` is the day of the first training."""

    starts_on: dt.date
    template: Literal["six_weeks"] = "six_weeks"


class PlannedVisitChange(Request):
    """Another day of a planned visit, or the session that it was (null: it was none)."""

    planned_on: dt.date = dt.date.min
    session_id: HexId | None = None


class PlannedVisit(Response):
    """A visit of a programme; week 1 is that of the first training."""

    id: str
    label: str
    kind: Literal["assessment", "training"]
    week: int
    planned_on: dt.date
    session_id: str | None
    performed_on: dt.date | None
    state: Literal["done", "missing", "next", "planned"]


class Programme(Response):
    """The visits that are planned for a patient, in the order of their days."""

    id: str
    patient_id: str
    template: str
    words: str
    starts_on: dt.date
    created_at: dt.datetime
    visits: list[PlannedVisit]


class Session(Response):
    """A visit; its state: empty, uploaded, running, done or failed."""

    id: str
    patient_id: str
    patient_code: str
    title: str
    performed_on: dt.date
    protocol: str
    height_m: float | None
    pace: WalkingPace | None
    aid: WalkingAid | None
    orthosis: Orthosis | None
    shoes: Footwear | None
    feedback: bool
    note: str
    created_at: dt.datetime
    state: str


class StoredFile(Response):
    """A file exactly as it was uploaded, or as an analysis wrote it."""

    name: str
    size: int
    sha256: str


class Job(Response):
    """A piece of work for a worker; `stage`, `fraction` and `message` are its progress."""

    id: str
    kind: str
    recording_id: str | None
    state: Literal["queued", "running", "done", "failed", "cancelled"]
    attempt: int
    stage: str | None
    fraction: float | None
    message: str | None
    cancel_requested: bool
    error_code: str | None
    error_message: str | None
    created_at: dt.datetime
    started_at: dt.datetime | None
    finished_at: dt.datetime | None


class ListedJob(Job):
    """A job and whose it is."""

    session_id: str | None
    session_title: str | None
    patient_id: str | None
    patient_code: str | None


class Recording(Response):
    """The upload set of a session; `inspection` is what was found in it, before any mapping."""

    id: str
    session_id: str
    state: Literal["draft", "ready", "failed"]
    files: list[StoredFile]
    manifest: dict[str, Any] | None
    inspection: dict[str, Any] | None
    job: Job | None


class AnalysisNew(Request):
    """What to analyse with: a manifest (else the stored one), and settings that differ from the defaults."""

    manifest: Json | None = None
    config: Json | None = None


class Analysis(Response):
    """A finished analysis; its input, settings and code version give the same numbers again."""

    id: str
    recording_id: str
    session_id: str
    job_id: str
    input_sha256: str
    config_sha256: str
    code_version: str
    manifest: dict[str, Any] | None
    config: dict[str, Any]
    created_at: dt.datetime
    files: list[StoredFile]


class Report(Response):
    """Everything the pages of a session show, in degrees and words; undefined is null with a reason."""

    model_config = ConfigDict(extra="allow")

    problem: str | None
    quality: dict[str, Any]
    warnings: list[dict[str, Any]]
    key_numbers: list[dict[str, Any]]
    parameters: list[dict[str, Any]]
    curves: list[dict[str, Any]]
    strides: list[dict[str, Any]]
    duration_s: float
    norm_note: str
    curve_notes: list[str]
    angle_zero: str | None
    zero_offset_deg: dict[str, float]
    since: dict[str, Any] | None
    condition: str
    provenance: dict[str, Any]


class StrideFigure(Response):
    """The figure of one stride; null where it has none."""

    index: int
    side: str
    start_s: float
    end_s: float
    value: float | None
    text: str
    counted: bool
    excluded: str | None


class ParameterBehind(Response):
    """A parameter as in the table, its definition, and every stride of the list with its own figure."""

    parameter: dict[str, Any]
    definition: str
    strides: list[StrideFigure]


class AuditRow(Response):
    """Who opened or changed what, when; each row's hash covers the row before it."""

    seq: int
    at: dt.datetime
    user_id: str | None
    user_name: str | None
    action: str
    resource: str
    resource_id: str | None
    detail: dict[str, Any]
    hash: str


class Health(Response):
    """State of the process, or of one of its parts."""

    status: Literal["ok", "failing"]
    checks: dict[str, str] = {}
