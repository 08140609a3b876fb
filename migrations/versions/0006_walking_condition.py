"""The condition a session was walked in; nobody stated that of earlier ones, but feedback was kept."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import rebuild

revision = "0006"
down_revision = "0005"

STATED = ("pace", "aid", "orthosis", "shoes")

TOLD = sa.text(
    "SELECT live_take.session_id, live_event.content FROM live_event "
    "JOIN live_take ON live_take.id = live_event.take_id "
    "WHERE live_event.kind = 'cue' AND live_take.recording_id = ("
    "  SELECT recording.id FROM recording WHERE recording.session_id = live_take.session_id"
    "  ORDER BY recording.created_at DESC LIMIT 1)"
).columns(session_id=sa.String(), content=sa.JSON())


def upgrade() -> None:
    with op.batch_alter_table("session", recreate=rebuild()) as batch:
        for name in STATED:
            batch.add_column(sa.Column(name, sa.String(length=32), nullable=True))
        batch.add_column(sa.Column("feedback", sa.Boolean(), nullable=False, server_default=sa.false()))
    connection = op.get_bind()
    told = {session_id for session_id, cue in connection.execute(TOLD) if _with_feedback(cue)}
    for session_id in sorted(told):
        row = sa.text("UPDATE session SET feedback = :told WHERE id = :id")
        connection.execute(row, {"id": session_id, "told": True})


def _with_feedback(cue: dict[str, object]) -> bool:
    # where only good, or only bad strides are shown, silence tells as well
    return bool(cue.get("shown")) or cue.get("why_not") in {"positive_only", "bandwidth"}


def downgrade() -> None:
    with op.batch_alter_table("session", recreate=rebuild()) as batch:
        for name in ("feedback", *STATED):
            batch.drop_column(name)
