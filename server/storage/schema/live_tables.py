"""Tables of live trials and their events; for conventions see storage/tables.py."""

from __future__ import annotations

from sqlalchemy import CheckConstraint, Column, Float, Index, Integer, String, Table, text

from sagittal.server.storage.schema.append_only import make_append_only
from sagittal.server.storage.schema.columns import Json, Utc, id_column, metadata, one_of, reference

TAKE_STATES = ("pairing", "open", "streaming", "finished", "closed")
OPEN_TAKE_STATES = ("pairing", "open", "streaming")
LIVE_EVENT_KINDS = (
    "start", "stop", "mark", "undo_mark", "feedback", "level", "pause", "redo_calibration",
    "ghost", "test", "prescription", "stale", "calibration", "cue", "guard", "notice",
)  # fmt: skip

live_take = Table(
    "live_take",
    metadata,
    id_column(),
    reference("session_id", "session"),
    Column("state", String(16), nullable=False),
    Column("code_sha256", String(64), unique=True),  # of the pairing code; None once used
    Column("code_expires_at", Utc),
    Column("token_sha256", String(64), unique=True),  # of the tablet's token, valid for this trial only
    Column("token_expires_at", Utc),
    reference("opened_by", "user", nullable=True, index=False),
    reference("prescription_id", "prescription", nullable=True, index=False),  # in force at its start
    Column("source", String(32)),  # data source declared by the tablet
    Column("count", Integer),  # batches at the end
    Column("sha256", String(64)),  # of all payloads, as declared by the tablet at the end
    reference("recording_id", "recording", nullable=True, index=False),  # None: not stored, or no data
    Column("problem", String(64)),  # code of a problem at the end
    Column("created_at", Utc, nullable=False),
    Column("finished_at", Utc),
    Column("node", String(32)),  # the web server that has its log (node_tables.py); None: an unnamed server
    Column("node_run", Integer),  # run of that server
    one_of("state", TAKE_STATES),
    CheckConstraint("(state IN ('finished', 'closed')) = (finished_at IS NOT NULL)", name="finished"),
)

_OPEN_TAKE = text("state IN ('pairing', 'open', 'streaming')")
Index(
    "uq_live_take_open",
    live_take.c.session_id,
    unique=True,
    sqlite_where=_OPEN_TAKE,
    postgresql_where=_OPEN_TAKE,
)

live_event = Table(
    "live_event",
    metadata,
    Column("seq", Integer, primary_key=True, autoincrement=True),
    reference("take_id", "live_take"),
    Column("kind", String(16), nullable=False),
    Column("t_s", Float),  # on the trial's time axis; None before its first sample
    Column("content", Json, nullable=False),
    reference("user_id", "user", nullable=True, index=False),  # None: the estimator
    Column("at", Utc, nullable=False),
    one_of("kind", LIVE_EVENT_KINDS),
    sqlite_autoincrement=True,
)

make_append_only(live_event, ("UPDATE",), "live events are append-only")
