"""Tables, in portable types: string ids (uuid4 hex), JSON, UTC times, CHECK constraints, no native enums.

Nothing is deleted by cascade (RESTRICT everywhere): clinical rows leave only through services/erasure.py.

patient ─< session ─< recording ─< recording_file          user ─< login_session, one_time_token
                          └──< analysis ─< analysis_file    audit (append-only, refers to nothing)
        │          │      ├──< job ─── analysis ─< edit (append-only, undo is a row too)
        │          │      │               └──< filter_run ─< filter_run_file
        │          │      └──< device_check (of the session's last published analysis)
        │          ├──< reference_file, file_upload, session_video (at most one), assessment (at most one)
        │          └──< signed_report ─< report_file
        │                             └──< report_link
        ├──< patient_note
        ├──< programme ─< planned_visit ─── session (at most one each)
        └──< prescription ─< live_take >── session, recording (the one it became)
                                 └──< live_event (append-only)
user ─< api_token, second_factor, security_key; patient ─< consent (storage/person_tables.py)
patient ─< care_team_member, emergency_access >── user (storage/care_tables.py)

Reports, live takes and what opens an account have modules of their own; `metadata` has the tables of all.
"""

from __future__ import annotations

from sqlalchemy import (
    Boolean,
    CheckConstraint,
    Column,
    Date,
    Float,
    ForeignKey,
    Index,
    Integer,
    String,
    Table,
    Text,
    UniqueConstraint,
    false,
    text,
)

from sagittal.server.storage.schema.append_only import make_append_only
from sagittal.server.storage.schema.columns import Json, UserJson, UserLines, UserString, Utc
from sagittal.server.storage.schema.columns import describe_file as _describe_file
from sagittal.server.storage.schema.columns import id_column as _id
from sagittal.server.storage.schema.columns import metadata as metadata
from sagittal.server.storage.schema.columns import new_id as new_id
from sagittal.server.storage.schema.columns import now as now
from sagittal.server.storage.schema.columns import one_of as _one_of
from sagittal.server.storage.schema.columns import owner as _owner
from sagittal.server.storage.schema.columns import reference as _ref

SEXES = ("female", "male")
SIDES = ("left", "right")
ROLES = ("admin", "clinician", "assistant", "viewer")
JOB_STATES = ("queued", "running", "done", "failed", "cancelled")
ACTIVE_STATES = ("queued", "running")
TOKEN_PURPOSES = ("set_up", "sign_in")
VISIT_KINDS = ("assessment", "training")
EDIT_KINDS = ("move_event", "add_event", "delete_event", "exclude_stride", "include_stride", "undo")


patient = Table(
    "patient",
    metadata,
    _id(),
    Column("code", UserString(64), nullable=False, unique=True),  # the clinic's pseudonym, shown everywhere
    Column("sex", String(8)),
    Column("birth_year", Integer),
    Column("height_m", Float),
    Column("affected_side", String(8)),
    Column("is_control", Boolean, nullable=False, server_default=false()),
    Column("note", UserLines, nullable=False),
    Column("created_at", Utc, nullable=False),
    _one_of("sex", SEXES),
    _one_of("affected_side", SIDES),
    CheckConstraint("birth_year BETWEEN 1850 AND 2200", name="birth_year"),
    CheckConstraint("height_m BETWEEN 0.5 AND 2.5", name="height_m"),
)

patient_note = Table(
    "patient_note",
    metadata,
    _id(),
    _ref("patient_id", "patient"),
    Column("written_on", Date, nullable=False),
    Column("content", UserLines, nullable=False),
    Column("created_at", Utc, nullable=False),
    _ref("created_by", "user", nullable=True, index=False),
)

session = Table(
    "session",
    metadata,
    _id(),
    _ref("patient_id", "patient"),
    Column("title", UserString(200), nullable=False),
    Column("performed_on", Date, nullable=False),
    Column("protocol", String(32), nullable=False),
    Column("height_m", Float),
    # walking condition (core/subject/condition.py); None: not recorded
    Column("pace", String(32)),
    Column("aid", String(32)),
    Column("orthosis", String(32)),
    Column("shoes", String(32)),
    Column("feedback", Boolean, nullable=False, server_default=false()),
    Column("note", UserLines, nullable=False),
    Column("created_at", Utc, nullable=False),
    CheckConstraint("height_m BETWEEN 0.5 AND 2.5", name="height_m"),
)

recording = Table(
    "recording",
    metadata,
    _id(),
    _ref("session_id", "session"),
    Column("manifest", UserJson),  # the latest confirmed mapping; every analysis keeps its own copy
    Column("inspection", Json),  # inspection results, before any mapping
    Column("wanted_key", String(300)),  # key of the analysis requested last
    Column("created_at", Utc, nullable=False),
)

recording_file = Table(
    "recording_file",
    metadata,
    _owner("recording_id", "recording"),
    Column("name", UserString(500), primary_key=True),  # as uploaded, including folders; any Unicode
    *_describe_file(),
    Column("added_at", Utc, nullable=False),
)

file_upload = Table(
    "file_upload",  # a file uploaded in parts (services/uploads.py)
    metadata,
    _id(),
    _ref("session_id", "session"),
    Column("name", UserString(500), nullable=False),
    Column("size", Integer, nullable=False),  # of the complete file, as announced
    Column("finished_sha256", String(64)),  # None: incomplete
    Column("created_at", Utc, nullable=False),
    CheckConstraint("size >= 1", name="size"),
)

user = Table(
    "user",
    metadata,
    _id(),
    Column("name", UserString(64), nullable=False, unique=True),  # sign-in name, lower case
    Column("display_name", UserString(200), nullable=False),
    Column("role", String(16), nullable=False),
    Column("password_hash", String(255)),  # None until the set-up link is used
    Column("active", Boolean, nullable=False),
    Column("created_at", Utc, nullable=False),
    Column("language", String(8)),  # of the pages (web/language.py); None: the browser's
    _one_of("role", ROLES),
)

login_session = Table(
    "login_session",
    metadata,
    Column("token_sha256", String(64), primary_key=True),  # the token itself is only in the browser's cookie
    _ref("user_id", "user"),
    Column("created_at", Utc, nullable=False),
    Column("last_seen_at", Utc, nullable=False),
    Column("expires_at", Utc, nullable=False),
)

one_time_token = Table(
    "one_time_token",
    metadata,
    Column("token_sha256", String(64), primary_key=True),
    _ref("user_id", "user", nullable=True),  # None: the first administrator, not yet created
    Column("purpose", String(16), nullable=False),
    Column("expires_at", Utc, nullable=False),
    Column("used_at", Utc),
    _one_of("purpose", TOKEN_PURPOSES),
)

job = Table(
    "job",
    metadata,
    Column("seq", Integer, primary_key=True, autoincrement=True),  # order of submission
    Column("id", String(32), nullable=False, unique=True),
    Column("key", String(300), nullable=False),  # computation; at most one pending or successful job per key
    Column("kind", String(32), nullable=False),
    _ref("recording_id", "recording", nullable=True),
    _ref("requested_by", "user", nullable=True),
    Column("params", Json, nullable=False),
    Column("priority", Integer, nullable=False),  # smaller first
    Column("state", String(16), nullable=False),
    Column("attempt", Integer, nullable=False),  # number of claims: the fence
    Column("deaths", Integer, nullable=False),  # claims that ended in a crash
    Column("released", Integer, nullable=False, server_default="0"),  # claims that were released
    Column("worker", String(100)),
    Column("lease_until", Utc),
    Column("cancel_requested", Boolean, nullable=False),
    Column("stage", String(64)),
    Column("fraction", Float),
    Column("message", String(500)),
    Column("checkpoint", String(64)),  # sha256 of the checkpoint for the next attempt
    Column("error_code", String(64)),
    Column("error_message", Text),
    Column("created_at", Utc, nullable=False),
    Column("started_at", Utc),
    Column("finished_at", Utc),
    _one_of("state", JOB_STATES),
    CheckConstraint("fraction BETWEEN 0 AND 1", name="fraction"),
    CheckConstraint("(state = 'running') = (lease_until IS NOT NULL AND worker IS NOT NULL)", name="lease"),
    CheckConstraint("(state = 'failed') = (error_code IS NOT NULL)", name="error"),
    CheckConstraint(
        "(state IN ('done', 'failed', 'cancelled')) = (finished_at IS NOT NULL)", name="finished"
    ),
)

_LIVE_OR_DONE = text("state IN ('queued', 'running', 'done')")
Index("uq_job_key", job.c.key, unique=True, sqlite_where=_LIVE_OR_DONE, postgresql_where=_LIVE_OR_DONE)
Index("ix_job_state", job.c.state, job.c.priority, job.c.seq)

analysis = Table(
    "analysis",
    metadata,
    _id(),
    _ref("recording_id", "recording"),
    Column("job_id", ForeignKey("job.id", ondelete="RESTRICT"), nullable=False),
    Column("input_sha256", String(64), nullable=False),
    Column("config_sha256", String(64), nullable=False),
    Column("code_version", String(64), nullable=False),
    Column("manifest", UserJson),
    Column("config", Json, nullable=False),
    Column("created_at", Utc, nullable=False),
    UniqueConstraint("job_id"),  # one visible result per job
)

analysis_file = Table(
    "analysis_file",
    metadata,
    _owner("analysis_id", "analysis"),
    Column("name", String(100), primary_key=True),
    *_describe_file(),
)

device_check = Table(
    "device_check",
    metadata,
    _owner("recording_id", "recording"),
    Column("device_id", UserString(32), primary_key=True, index=True),  # a serial number, never a file name
    Column("segment", String(16), nullable=False),  # segment assigned by the analysis
    Column("exchanged", Boolean, nullable=False),  # its placement was declared wrongly: not suggested again
    Column("content", Json, nullable=False),  # sagittal.core.quality.devices.DeviceCheck
    Column("at", Utc, nullable=False),
)

reference_file = Table(
    "reference_file",
    metadata,
    _owner("session_id", "session"),
    Column("name", UserString(500), primary_key=True),  # as uploaded; orientations of another system
    *_describe_file(),
    Column("added_at", Utc, nullable=False),
)

session_video = Table(
    "session_video",
    metadata,
    _owner("session_id", "session"),
    Column("name", UserString(500), nullable=False),
    Column("media_type", String(32), nullable=False),
    *_describe_file(),
    Column("offset_s", Float),  # video time at trial time 0; None: not aligned
    # user who confirmed consent; not a foreign key, as accounts may be deleted
    Column("consent_by", UserString(64)),
    Column("consent_at", Utc, nullable=False),
)

filter_run = Table(
    "filter_run",
    metadata,
    _id(),
    _ref("analysis_id", "analysis"),
    Column("job_id", ForeignKey("job.id", ondelete="RESTRICT"), nullable=False),
    Column("settings", Json, nullable=False),  # sagittal.core.filter_comparison.FilterRequest
    Column("reference_name", UserString(500)),  # None: compared with each other only
    Column("reference_sha256", String(64)),
    Column("code_version", String(64), nullable=False),
    Column("created_at", Utc, nullable=False),
    UniqueConstraint("job_id"),
)

filter_run_file = Table(
    "filter_run_file",
    metadata,
    _owner("filter_run_id", "filter_run"),
    Column("name", String(100), primary_key=True),
    *_describe_file(),
)

edit = Table(
    "edit",
    metadata,
    Column("seq", Integer, primary_key=True, autoincrement=True),
    _ref("analysis_id", "analysis"),
    Column("kind", String(16), nullable=False),
    Column("content", Json, nullable=False),  # sagittal.core.events.edits.Edit; {} for an undo
    _ref("user_id", "user", nullable=True, index=False),
    Column("at", Utc, nullable=False),
    _one_of("kind", EDIT_KINDS),
    sqlite_autoincrement=True,  # numbers are never reused: they identify the state of a review
)

tuning = Table(
    "tuning",
    metadata,
    _id(),
    _ref("recording_id", "recording"),
    Column("job_id", ForeignKey("job.id", ondelete="RESTRICT"), nullable=False),
    Column("input_sha256", String(64), nullable=False),
    Column("code_version", String(64), nullable=False),
    Column("result", Json, nullable=False),  # sagittal.core.fusion.algorithms.tuning.TuningResult
    Column("created_at", Utc, nullable=False),
    UniqueConstraint("job_id"),  # one visible result per job
)

programme = Table(
    "programme",
    metadata,
    _id(),
    _ref("patient_id", "patient"),
    Column("template", String(32), nullable=False),
    Column("starts_on", Date, nullable=False),  # day of the first training
    Column("created_at", Utc, nullable=False),
)

planned_visit = Table(
    "planned_visit",
    metadata,
    _id(),
    _ref("programme_id", "programme"),
    Column("position", Integer, nullable=False),  # order within the programme
    Column("label", String(16), nullable=False),
    Column("kind", String(16), nullable=False),
    Column("week", Integer, nullable=False),  # of the programme, 1 = that of the first training
    Column("planned_on", Date, nullable=False),
    _ref("session_id", "session", nullable=True, index=False),  # the linked session
    _one_of("kind", VISIT_KINDS),
    UniqueConstraint("session_id"),
    UniqueConstraint("programme_id", "position"),
)

prescription = Table(
    "prescription",
    metadata,
    _id(),
    _ref("patient_id", "patient"),
    Column("content", Json, nullable=False),  # sagittal.core.feedback.Prescription
    Column("created_at", Utc, nullable=False),
    _ref("created_by", "user", nullable=True, index=False),
    Column("ended_at", Utc),  # None: in force
)

audit = Table(
    "audit",
    metadata,
    Column("seq", Integer, primary_key=True, autoincrement=True),
    Column("at", Utc, nullable=False),
    Column("user_id", String(32)),  # not a foreign key: the trail outlives the resources it refers to
    Column("user_name", UserString(64)),
    Column("action", String(64), nullable=False),
    Column("resource", String(32), nullable=False),
    Column("resource_id", String(64)),
    Column("detail", Json, nullable=False),
    Column("previous", String(64), nullable=False),
    Column("hash", String(64), nullable=False, unique=True),
    sqlite_autoincrement=True,
)
Index("ix_audit_resource", audit.c.resource, audit.c.resource_id)

make_append_only(audit, ("UPDATE", "DELETE"), "audit rows are append-only")
make_append_only(edit, ("UPDATE",), "edits are append-only")
