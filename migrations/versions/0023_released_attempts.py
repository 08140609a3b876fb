"""Attempts at a job that were given back unharmed, which are not shown as attempts."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import rebuild

revision = "0023"
down_revision = "0022"


def upgrade() -> None:
    with op.batch_alter_table("job", recreate=rebuild()) as batch:
        batch.add_column(sa.Column("released", sa.Integer(), server_default="0", nullable=False))


def downgrade() -> None:
    with op.batch_alter_table("job", recreate=rebuild()) as batch:
        batch.drop_column("released")
