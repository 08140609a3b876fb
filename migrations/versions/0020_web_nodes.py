"""Several web servers: who they are, who owns a live take, failures that they count together."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import rebuild

revision = "0020"
down_revision = "0019"


def upgrade() -> None:
    op.create_table(
        "web_node",
        sa.Column("name", sa.String(length=32), nullable=False),
        sa.Column("address", sa.String(length=300), nullable=False),
        sa.Column("key_sha256", sa.String(length=64), nullable=False),
        sa.Column("run", sa.Integer(), nullable=False),
        sa.Column("started_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("beat_at", sa.DateTime(timezone=True), nullable=True),
        sa.CheckConstraint("run >= 1", name=op.f("ck_web_node_run")),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_web_node")),
    )
    op.create_table(
        "failed_attempt",
        sa.Column("id", sa.String(length=32), nullable=False),
        sa.Column("account", sa.Text(), nullable=True),
        sa.Column("address", sa.Text(), nullable=True),
        sa.Column("at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_failed_attempt")),
    )
    op.create_index(op.f("ix_failed_attempt_at"), "failed_attempt", ["at"], unique=False)
    op.create_index("ix_failed_attempt_key", "failed_attempt", ["account", "address", "at"], unique=False)
    with op.batch_alter_table("live_take", recreate=rebuild()) as batch:
        batch.add_column(sa.Column("node", sa.String(length=32), nullable=True))
        batch.add_column(sa.Column("node_run", sa.Integer(), nullable=True))


def downgrade() -> None:
    with op.batch_alter_table("live_take", recreate=rebuild()) as batch:
        batch.drop_column("node_run")
        batch.drop_column("node")
    op.drop_table("failed_attempt")
    op.drop_table("web_node")
