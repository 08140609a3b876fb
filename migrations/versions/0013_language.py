"""The language in which a person reads the pages."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import rebuild

revision = "0013"
down_revision = "0012"


def upgrade() -> None:
    with op.batch_alter_table("user", recreate=rebuild()) as batch:
        batch.add_column(sa.Column("language", sa.String(length=8), nullable=True))


def downgrade() -> None:
    with op.batch_alter_table("user", recreate=rebuild()) as batch:
        batch.drop_column("language")
