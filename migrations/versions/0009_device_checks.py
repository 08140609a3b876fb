"""What each analysed take showed of its devices; earlier analyses say it when they are run again."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"


def upgrade() -> None:
    op.create_table(
        "device_check",
        sa.Column("recording_id", sa.String(length=32), nullable=False),
        sa.Column("device_id", sa.String(length=32), nullable=False),
        sa.Column("segment", sa.String(length=16), nullable=False),
        sa.Column("exchanged", sa.Boolean(), nullable=False),
        sa.Column("content", sa.JSON(), nullable=False),
        sa.Column("at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["recording_id"],
            ["recording.id"],
            name=op.f("fk_device_check_recording_id_recording"),
            ondelete="RESTRICT",
        ),
        sa.PrimaryKeyConstraint("recording_id", "device_id", name=op.f("pk_device_check")),
    )
    op.create_index(op.f("ix_device_check_device_id"), "device_check", ["device_id"], unique=False)


def downgrade() -> None:
    op.drop_table("device_check")
