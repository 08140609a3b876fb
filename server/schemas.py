"""What goes over the wire: every request and response of /api/v1."""

from __future__ import annotations

import datetime as dt
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from server.auth.passwords import MAX_LENGTH, MIN_LENGTH
from server.auth.roles import Role

# one line of text: starts and ends with something visible, no control characters
_LINE = r"^[^\s\x00-\x1f\x7f]([^\x00-\x1f\x7f]*[^\s\x00-\x1f\x7f])?$"
Line = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=_LINE)]
Code = Annotated[str, StringConstraints(min_length=1, max_length=64, pattern=_LINE)]
SignInName = Annotated[
    str, StringConstraints(min_length=1, max_length=64, pattern=r"^[a-z0-9][a-z0-9._@-]*$")
]
Note = Annotated[str, StringConstraints(max_length=10_000)]
Password = Annotated[str, StringConstraints(min_length=MIN_LENGTH, max_length=MAX_LENGTH)]
Height = Annotated[float, Field(ge=0.5, le=2.5, allow_inf_nan=False, description="m")]
BirthYear = Annotated[int, Field(ge=1850, le=2200)]
Sex = Literal["female", "male"]
ProtocolName = Literal["walk", "treadmill"]
Json = dict[str, Any]


class Request(BaseModel):
    """A body we receive: unknown members are refused, so a misspelt one is not silently ignored."""

    model_config = ConfigDict(extra="forbid")


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
    note: Note = ""


class PatientChange(Request):
    """What to change of a patient; members left out stay as they are."""

    code: Code = ""
    sex: Sex | None = None
    birth_year: BirthYear | None = None
    height_m: Height | None = None
    note: Note = ""


class Patient(Response):
    """A patient."""

    id: str
    code: str
    sex: Sex | None
    birth_year: int | None
    height_m: float | None
    note: str
    created_at: dt.datetime


class SessionNew(Request):
    """A new visit."""

    title: Line
    performed_on: dt.date
    protocol: ProtocolName = "walk"
    height_m: Height | None = None
    note: Note = ""


class SessionChange(Request):
    """What to change of a session; members left out stay as they are."""

    title: Line = ""
    performed_on: dt.date = dt.date.min
    protocol: ProtocolName = "walk"
    height_m: Height | None = None
    note: Note = ""


class Session(Response):
    """A visit."""

    id: str
    patient_id: str
    title: str
    performed_on: dt.date
    protocol: str
    height_m: float | None
    note: str
    created_at: dt.datetime


class StoredFile(Response):
    """A file exactly as it was uploaded, or as an analysis wrote it."""

    name: str
    size: int
    sha256: str


class Recording(Response):
    """The upload set of a session; `inspection` is what was found in it, before any mapping."""

    id: str
    session_id: str
    state: Literal["draft", "ready", "failed"]
    files: list[StoredFile]
    manifest: Json | None
    inspection: Json | None


class AnalysisNew(Request):
    """What to analyse with; without a manifest the stored one is used."""

    manifest: Json | None = None
    config: Json | None = None


class Analysis(Response):
    """A finished analysis; its input, settings and code version give the same numbers again."""

    id: str
    recording_id: str
    job_id: str
    input_sha256: str
    config_sha256: str
    code_version: str
    manifest: Json | None
    config: Json
    created_at: dt.datetime
    files: list[StoredFile]


class Job(Response):
    """A piece of work for a worker."""

    id: str
    kind: str
    recording_id: str | None
    state: Literal["queued", "running", "done", "failed", "cancelled"]
    stage: str | None
    fraction: float | None
    message: str | None
    error_code: str | None
    error_message: str | None
    cancel_requested: bool
    created_at: dt.datetime
    started_at: dt.datetime | None
    finished_at: dt.datetime | None


class AuditRow(Response):
    """Who opened or changed what, when; each row's hash covers the row before it."""

    seq: int
    at: dt.datetime
    user_id: str | None
    user_name: str | None
    action: str
    resource: str
    resource_id: str | None
    detail: Json
    hash: str


class Health(Response):
    """State of the process, or of one of its parts."""

    status: Literal["ok", "failing"]
    checks: dict[str, str] = {}
