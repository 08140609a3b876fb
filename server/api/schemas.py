"""Schemas of /api/v1: validated requests, and responses that differ from service records."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from sagittal.core.frames import Protocol
from sagittal.core.subject.condition import Footwear, Orthosis, WalkingAid, WalkingPace
from sagittal.server.clinic.identities import MOST
from sagittal.server.clinic.notes import MOST_CHARACTERS
from sagittal.server.jobs.queue import JobView
from sagittal.server.report.view.behind import StrideValue
from sagittal.server.results.tunings import MOST_OF_SWARM, Scheme
from sagittal.server.sharing import report_links, signed_reports
from sagittal.server.sharing.care_teams import REASON, EmergencyAccess, TeamMember
from sagittal.server.storage.schema.tables import now
from sagittal.server.uploads.recordings import RecordedFile, RecordingState

_HIDDEN = "\u00ad\u200b\u200e\u200f\u202a-\u202e\u2060-\u206f\ufeff"
"""Invisible characters and those that reverse the text direction (Unicode, category Cf)."""
_JOINERS = "\u200c\u200d"
"""Also invisible, but required by some scripts and emoji; not allowed in a patient's code."""


def _one_line(refused: str) -> str:
    """Pattern of a single line that starts and ends with a visible character, without control characters."""
    # up to 9f, as U+0085 is a space here but not in JSON Schema
    no = f"\\x00-\\x1f\\x7f-\\x9f{refused}"
    return f"^[^\\s{no}]([^{no}]*[^\\s{no}])?$"


_NO_TEXT = f"\\x00-\\x08\\x0b\\x0c\\x0e-\\x1f\\x7f{_HIDDEN}"
# multi-line text
_TEXT = f"^[^{_NO_TEXT}]*$"
Line = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=_one_line(_HIDDEN))]
Code = Annotated[str, StringConstraints(min_length=1, max_length=64, pattern=_one_line(_HIDDEN + _JOINERS))]
Note = Annotated[str, StringConstraints(max_length=10_000, pattern=_TEXT)] | None
SomeText = Annotated[
    str,
    StringConstraints(
        min_length=1,
        max_length=MOST_CHARACTERS,
        pattern=f"^[^{_NO_TEXT}]*[^\\s{_NO_TEXT}][^{_NO_TEXT}]*$",
    ),
]
Height = Annotated[float, Field(ge=0.5, le=2.5, allow_inf_nan=False, description="m")]
BirthYear = Annotated[int, Field(ge=1850, le=now().year)]
Sex = Literal["female", "male"]
Side = Literal["left", "right"]
HexId = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{32}$")]
Answer = TypeVar("Answer")
Json = dict[str, Any]


class Request(BaseModel):
    """A request body; unknown fields are rejected, so that misspelt ones are not ignored."""

    model_config = ConfigDict(extra="forbid")

    def values(self) -> dict[str, Any]:
        """Return the fields that were sent; an empty note is stored as text."""
        sent = self.model_dump(exclude_unset=True)
        return sent | ({"note": ""} if "note" in sent and sent["note"] is None else {})


def make_answer(kind: type[Answer], source: object, **overrides: object) -> Answer:
    """Build a response from a row or a result.

    Parameters
    ----------
    kind : a dataclass. source : object with attributes of the same names; others are omitted.
    overrides : fields that `source` lacks or that need conversion.
    """
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]  # any dataclass
    return kind(**{name: overrides[name] if name in overrides else getattr(source, name) for name in names})


@dataclass(frozen=True)
class FieldProblem:
    """An invalid field."""

    field: str
    message: str


@dataclass(frozen=True)
class ProblemDetails:
    """RFC 9457; `code` is stable, `detail` is a sentence with the remedy."""

    type: str
    title: str
    status: int
    detail: str
    code: str
    errors: list[FieldProblem] | None = None


class ConsentNew(Request):
    """A patient's consent: purpose, date and reference to the document."""

    purpose: Literal["recording", "research", "teaching", "sharing"]
    evidence: Line
    given_on: dt.date | None = None


@dataclass(frozen=True)
class CareTeams:
    """Whether the clinic has care teams."""

    on: bool


class CareTeamsSwitch(Request):
    """On or off; `begin_with_past` = users with earlier access to a patient join the team."""

    on: bool
    begin_with_past: bool = False


@dataclass(frozen=True)
class CareTeam:
    """Care team of a patient, and emergency access to the patient."""

    members: list[TeamMember]
    emergencies: list[EmergencyAccess]


class CareTeamChange(Request):
    """Members of the team, by account id."""

    users: Annotated[list[HexId], Field(max_length=1000)]


class EmergencyOpening(Request):
    """The exact code of a patient, and the reason for emergency access from outside the team."""

    code: Code
    reason: Annotated[str, StringConstraints(min_length=REASON[0], max_length=REASON[1], pattern=_TEXT)]


class IdentityChange(Request):
    """Changes to a patient's identity; null clears a value, omitted fields are unchanged."""

    name: Annotated[Line, Field(max_length=MOST["name"])] | None = None
    born_on: dt.date | None = None
    record_number: Annotated[Line, Field(max_length=MOST["record_number"])] | None = None
    insurance_number: Annotated[Line, Field(max_length=MOST["insurance_number"])] | None = None
    contact: Annotated[str, StringConstraints(max_length=MOST["contact"], pattern=_TEXT)] | None = None


class PatientNew(Request):
    """A new patient with the clinic's own pseudonym."""

    code: Code
    sex: Sex | None = None
    birth_year: BirthYear | None = None
    height_m: Height | None = None
    affected_side: Side | None = None
    is_control: bool = False
    note: Note = None


class PatientChange(PatientNew):
    """Changes to a patient; omitted fields are unchanged."""

    code: Code = ""


class Assessment(Request):
    """The therapist's assessment on a report; empty or null = none."""

    content: Annotated[
        Note, Field(description=f"at most {signed_reports.ASSESSMENT_CHARACTERS} characters, trimmed")
    ]


class Reopening(Request):
    """Reason for reopening a signed report."""

    reason: SomeText


class ReportLinkNew(Request):
    """Lifetime of a link to a report."""

    days: Annotated[int, Field(ge=1, le=report_links.MOST_DAYS)] = report_links.USUAL_DAYS


class NoteNew(Request):
    """A note about a patient, dated today by default."""

    content: SomeText
    written_on: dt.date = dt.date.min


class SessionNew(Request):
    """A new visit, today by default; null walking conditions = not recorded."""

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
    """Changes to a session; omitted fields are unchanged."""


class PlannedSessionNew(SessionNew):
    """A new visit, optionally one that was planned in a programme."""

    planned_visit_id: HexId | None = None


class ProgrammeNew(Request):
    """A programme for a patient; `starts_on` is the date of the first training."""

    starts_on: dt.date
    template: Literal["six_weeks"] = "six_weeks"


class PlannedVisitChange(Request):
    """New date of a planned visit, or its session (null: none)."""

    planned_on: dt.date = dt.date.min
    session_id: HexId | None = None


class VideoAlignment(Request):
    """Video time at trial time 0, in seconds; null removes the alignment."""

    offset_s: Annotated[float, Field(allow_inf_nan=False)] | None


@dataclass(frozen=True)
class RecordingAnswer:
    """Upload set of a session; `inspection` holds the inspection results before any mapping."""

    id: str
    session_id: str
    state: RecordingState
    files: tuple[RecordedFile, ...]
    manifest: dict[str, Any] | None
    inspection: dict[str, Any] | None
    job: JobView | None


class AnalysisNew(Request):
    """Manifest (default: the stored one) and non-default settings of an analysis."""

    manifest: Json | None = None
    config: Json | None = None


class TuningNew(Request):
    """Filter to tune and validation trials; it is fitted to the session's other trials."""

    algorithm: Line
    validation: Annotated[
        tuple[Line, ...], Field(min_length=1, max_length=100, description="names without .npz")
    ]
    scheme: Scheme | None = None
    magnetometer: bool | None = None
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    particles: Annotated[int, Field(ge=1, le=MOST_OF_SWARM["particles"])] | None = None
    iterations: Annotated[int, Field(ge=1, le=MOST_OF_SWARM["iterations"])] | None = None
    rounds: Annotated[int, Field(ge=1, le=MOST_OF_SWARM["rounds"])] | None = None
    random_rounds: Annotated[int, Field(ge=1, le=MOST_OF_SWARM["random_rounds"])] | None = None


@dataclass(frozen=True)
class AnalysisAnswer:
    """A finished analysis; it is reproducible from its input, settings and code version."""

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
    files: list[RecordedFile]


@dataclass(frozen=True)
class ReportAnswer:
    """Everything shown on the pages of a session, in degrees and words; undefined is null with a reason."""

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
    estimator: dict[str, Any] | None
    profile: dict[str, Any] | None
    limits: dict[str, Any] | None
    squats: dict[str, Any] | None
    functional: dict[str, Any] | None
    daily: dict[str, Any] | None


@dataclass(frozen=True)
class ParameterBehind:
    """A parameter as in the table, its definition, and the value of every stride."""

    parameter: dict[str, Any]
    definition: str
    strides: list[StrideValue]


@dataclass(frozen=True)
class AuditRow:
    """User, action and time of an access or change; each row's hash covers the previous row."""

    seq: int
    at: dt.datetime
    user_id: str | None
    user_name: str | None
    action: str
    resource: str
    resource_id: str | None
    detail: dict[str, Any]
    hash: str


@dataclass(frozen=True)
class AuditHead:
    """Number and hash of the newest row of the audit log."""

    seq: int
    hash: str


@dataclass(frozen=True)
class HealthAnswer:
    """State of the process or one of its components."""

    status: Literal["ok", "failing"]
    checks: dict[str, str] = field(default_factory=dict)
