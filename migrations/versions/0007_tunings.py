"""Tunings of filters, and what a long job goes on from."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import rebuild

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    with op.batch_alter_table("job", recreate=rebuild()) as batch:
        batch.add_column(sa.Column("checkpoint", sa.String(length=64), nullable=True))
    op.create_table(
        "tuning",
        sa.Column("id", sa.String(length=32), nullable=False),
        sa.Column("recording_id", sa.String(length=32), nullable=False),
        sa.Column("job_id", sa.String(length=32), nullable=False),
        sa.Column("input_sha256", sa.String(length=64), nullable=False),
        sa.Column("code_version", sa.String(length=64), nullable=False),
        sa.Column("result", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["recording_id"],
            ["recording.id"],
            name=op.f("fk_tuning_recording_id_recording"),
            ondelete="RESTRICT",
        ),
        sa.ForeignKeyConstraint(
            ["job_id"], ["job.id"], name=op.f("fk_tuning_job_id_job"), ondelete="RESTRICT"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_tuning")),
        sa.UniqueConstraint("job_id", name=op.f("uq_tuning_job_id")),
    )
    op.create_index(op.f("ix_tuning_recording_id"), "tuning", ["recording_id"], unique=False)


def downgrade() -> None:
    op.drop_index(op.f("ix_tuning_recording_id"), table_name="tuning")
    op.drop_table("tuning")
    with op.batch_alter_table("job", recreate=rebuild()) as batch:
        batch.drop_column("checkpoint")
