"""Live takes, what happened in them, and prescriptions of biofeedback."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import forbid_changes

revision = "0005"
down_revision = "0004"

STATES = "'pairing', 'open', 'streaming', 'finished', 'closed'"
OPEN = sa.text("state IN ('pairing', 'open', 'streaming')")
KINDS = (
    "'start', 'stop', 'mark', 'undo_mark', 'feedback', 'level', 'pause', 'redo_calibration', 'ghost', "
    "'prescription', 'stale', 'calibration', 'cue', 'guard', 'notice'"
)


def upgrade() -> None:
    op.create_table(
        "prescription",
        sa.Column("id", sa.String(length=32), nullable=False),
        sa.Column("patient_id", sa.String(length=32), nullable=False),
        sa.Column("content", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("created_by", sa.String(length=32), nullable=True),
        sa.Column("ended_at", sa.DateTime(timezone=True), nullable=True),
        sa.ForeignKeyConstraint(
            ["patient_id"],
            ["patient.id"],
            name=op.f("fk_prescription_patient_id_patient"),
            ondelete="RESTRICT",
        ),
        sa.ForeignKeyConstraint(
            ["created_by"], ["user.id"], name=op.f("fk_prescription_created_by_user"), ondelete="RESTRICT"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_prescription")),
    )
    op.create_index(op.f("ix_prescription_patient_id"), "prescription", ["patient_id"], unique=False)
    op.create_table(
        "live_take",
        sa.Column("id", sa.String(length=32), nullable=False),
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("state", sa.String(length=16), nullable=False),
        sa.Column("code_sha256", sa.String(length=64), nullable=True),
        sa.Column("code_expires_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("token_sha256", sa.String(length=64), nullable=True),
        sa.Column("token_expires_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("opened_by", sa.String(length=32), nullable=True),
        sa.Column("prescription_id", sa.String(length=32), nullable=True),
        sa.Column("source", sa.String(length=32), nullable=True),
        sa.Column("count", sa.Integer(), nullable=True),
        sa.Column("sha256", sa.String(length=64), nullable=True),
        sa.Column("recording_id", sa.String(length=32), nullable=True),
        sa.Column("problem", sa.String(length=64), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("finished_at", sa.DateTime(timezone=True), nullable=True),
        sa.CheckConstraint(f"state IN ({STATES})", name=op.f("ck_live_take_state")),
        sa.CheckConstraint(
            "(state IN ('finished', 'closed')) = (finished_at IS NOT NULL)",
            name=op.f("ck_live_take_finished"),
        ),
        sa.ForeignKeyConstraint(
            ["session_id"], ["session.id"], name=op.f("fk_live_take_session_id_session"), ondelete="RESTRICT"
        ),
        sa.ForeignKeyConstraint(
            ["opened_by"], ["user.id"], name=op.f("fk_live_take_opened_by_user"), ondelete="RESTRICT"
        ),
        sa.ForeignKeyConstraint(
            ["prescription_id"],
            ["prescription.id"],
            name=op.f("fk_live_take_prescription_id_prescription"),
            ondelete="RESTRICT",
        ),
        sa.ForeignKeyConstraint(
            ["recording_id"],
            ["recording.id"],
            name=op.f("fk_live_take_recording_id_recording"),
            ondelete="RESTRICT",
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_live_take")),
        sa.UniqueConstraint("code_sha256", name=op.f("uq_live_take_code_sha256")),
        sa.UniqueConstraint("token_sha256", name=op.f("uq_live_take_token_sha256")),
    )
    op.create_index(op.f("ix_live_take_session_id"), "live_take", ["session_id"], unique=False)
    op.create_index(
        "uq_live_take_open",
        "live_take",
        ["session_id"],
        unique=True,
        sqlite_where=OPEN,
        postgresql_where=OPEN,
    )
    op.create_table(
        "live_event",
        sa.Column("seq", sa.Integer(), nullable=False),
        sa.Column("take_id", sa.String(length=32), nullable=False),
        sa.Column("kind", sa.String(length=16), nullable=False),
        sa.Column("t_s", sa.Float(), nullable=True),
        sa.Column("content", sa.JSON(), nullable=False),
        sa.Column("user_id", sa.String(length=32), nullable=True),
        sa.Column("at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint(f"kind IN ({KINDS})", name=op.f("ck_live_event_kind")),
        sa.ForeignKeyConstraint(
            ["take_id"], ["live_take.id"], name=op.f("fk_live_event_take_id_live_take"), ondelete="RESTRICT"
        ),
        sa.ForeignKeyConstraint(
            ["user_id"], ["user.id"], name=op.f("fk_live_event_user_id_user"), ondelete="RESTRICT"
        ),
        sa.PrimaryKeyConstraint("seq", name=op.f("pk_live_event")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_live_event_take_id"), "live_event", ["take_id"], unique=False)
    forbid_changes("live_event", ("UPDATE",), "live events are append-only")


def downgrade() -> None:
    op.drop_table("live_event")
    op.drop_table("live_take")
    op.drop_table("prescription")
