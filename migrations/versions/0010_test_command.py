"""A live take may be told to begin a functional test, to repeat it, and when it began and ended."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import forbid_changes, is_sqlite, rebuild

revision = "0010"
down_revision = "0009"

BEFORE = (
    "'start', 'stop', 'mark', 'undo_mark', 'feedback', 'level', 'pause', 'redo_calibration', 'ghost', "
    "'prescription', 'stale', 'calibration', 'cue', 'guard', 'notice'"
)
KINDS = BEFORE.replace("'ghost', ", "'ghost', 'test', ")


def upgrade() -> None:
    _allow(KINDS)


def downgrade() -> None:
    op.execute("DELETE FROM live_event WHERE kind = 'test'")
    _allow(BEFORE)


def _allow(kinds: str) -> None:
    with op.batch_alter_table(
        "live_event", recreate=rebuild(), table_kwargs={"sqlite_autoincrement": True}
    ) as batch:
        batch.drop_constraint(op.f("ck_live_event_kind"), type_="check")
        batch.create_check_constraint(op.f("ck_live_event_kind"), sa.text(f"kind IN ({kinds})"))
    if is_sqlite():  # the copy of a table has no trigger
        forbid_changes("live_event", ("UPDATE",), "live events are append-only")
