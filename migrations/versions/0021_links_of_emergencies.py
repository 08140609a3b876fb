"""An access in an emergency that somebody ended, and the links to reports that end with it."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import rebuild

revision = "0021"
down_revision = "0020"


def upgrade() -> None:
    with op.batch_alter_table("emergency_access", recreate=rebuild()) as batch:
        batch.add_column(sa.Column("ended_at", sa.DateTime(timezone=True), nullable=True))
    with op.batch_alter_table("report_link", recreate=rebuild()) as batch:
        batch.add_column(sa.Column("emergency_id", sa.String(length=32), nullable=True))
        batch.create_foreign_key(
            op.f("fk_report_link_emergency_id_emergency_access"),
            "emergency_access",
            ["emergency_id"],
            ["id"],
            ondelete="RESTRICT",
        )
    op.create_index(op.f("ix_report_link_emergency_id"), "report_link", ["emergency_id"], unique=False)


def downgrade() -> None:
    op.drop_index(op.f("ix_report_link_emergency_id"), table_name="report_link")
    with op.batch_alter_table("report_link", recreate=rebuild()) as batch:
        batch.drop_constraint(op.f("fk_report_link_emergency_id_emergency_access"), type_="foreignkey")
        batch.drop_column("emergency_id")
    op.execute(
        "UPDATE emergency_access SET ends_at = ended_at WHERE ended_at > opened_at AND ended_at < ends_at"
    )
    with op.batch_alter_table("emergency_access", recreate=rebuild()) as batch:
        batch.drop_column("ended_at")
