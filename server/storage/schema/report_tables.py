"""Tables of a session's report: assessment, signed versions, links.

For conventions see storage/tables.py.
"""

from __future__ import annotations

from sqlalchemy import CheckConstraint, Column, Integer, String, Table, UniqueConstraint

from sagittal.server.storage.schema.columns import (
    UserLines,
    UserString,
    Utc,
    describe_file,
    id_column,
    metadata,
    owner,
    reference,
)

assessment = Table(
    "assessment",
    metadata,
    owner("session_id", "session"),
    Column("content", UserLines, nullable=False),  # the therapist's assessment on the report
    Column("changed_at", Utc, nullable=False),
)

signed_report = Table(
    "signed_report",
    metadata,
    id_column(),
    reference("session_id", "session"),
    Column("number", Integer, nullable=False),  # version of the session's report, from 1
    # its analysis; not a foreign key, as the report is independent
    Column("analysis_id", String(32), nullable=False),
    Column("language", String(8), nullable=False),
    Column("signed_by", UserString(200)),  # name at that time; not a foreign key, as accounts may be deleted
    Column("signed_at", Utc, nullable=False),
    Column("reopened_by", UserString(200)),
    Column("reopened_at", Utc),  # None: in force
    Column("reopened_because", UserLines),
    UniqueConstraint("session_id", "number"),
    CheckConstraint("(reopened_at IS NULL) = (reopened_because IS NULL)", name="reopened"),
)

report_file = Table(
    "report_file",
    metadata,
    owner("report_id", "signed_report"),
    Column("name", String(32), primary_key=True),
    *describe_file(),
)

report_link = Table(
    "report_link",
    metadata,
    id_column(),
    reference("report_id", "signed_report"),
    Column("token_sha256", String(64), nullable=False, unique=True),  # the token is only in the URL
    Column("made_by", UserString(200)),
    reference("maker_id", "user", nullable=True, index=False),  # account; made_by is the name at that time
    Column("made_at", Utc, nullable=False),
    Column("expires_at", Utc, nullable=False),
    Column("revoked_at", Utc),
    Column("openings", Integer, nullable=False),
    Column("opened_at", Utc),  # last
    # in which it was created and with which it ends
    reference("emergency_id", "emergency_access", nullable=True),
    CheckConstraint("openings >= 0", name="openings"),
)
