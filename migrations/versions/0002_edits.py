"""Edits: what a person changed in the events and strides of an analysis."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import forbid_changes

revision = "0002"
down_revision = "0001"

KINDS = "'move_event', 'add_event', 'delete_event', 'exclude_stride', 'include_stride', 'undo'"


def upgrade() -> None:
    op.create_table(
        "edit",
        sa.Column("seq", sa.Integer(), nullable=False),
        sa.Column("analysis_id", sa.String(length=32), nullable=False),
        sa.Column("kind", sa.String(length=16), nullable=False),
        sa.Column("content", sa.JSON(), nullable=False),
        sa.Column("user_id", sa.String(length=32), nullable=True),
        sa.Column("at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint(f"kind IN ({KINDS})", name=op.f("ck_edit_kind")),
        sa.ForeignKeyConstraint(
            ["analysis_id"], ["analysis.id"], name=op.f("fk_edit_analysis_id_analysis"), ondelete="RESTRICT"
        ),
        sa.ForeignKeyConstraint(
            ["user_id"], ["user.id"], name=op.f("fk_edit_user_id_user"), ondelete="RESTRICT"
        ),
        sa.PrimaryKeyConstraint("seq", name=op.f("pk_edit")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_edit_analysis_id"), "edit", ["analysis_id"], unique=False)
    forbid_changes("edit", ("UPDATE",), "edits are append-only")


def downgrade() -> None:
    op.drop_table("edit")
