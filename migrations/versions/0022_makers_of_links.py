"""The account that made a link to a report, with which the link ends."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import rebuild

revision = "0022"
down_revision = "0021"


def upgrade() -> None:
    with op.batch_alter_table("report_link", recreate=rebuild()) as batch:
        batch.add_column(sa.Column("maker_id", sa.String(length=32), nullable=True))
        batch.create_foreign_key(
            op.f("fk_report_link_maker_id_user"), "user", ["maker_id"], ["id"], ondelete="RESTRICT"
        )
    # of earlier links only the audit log has the account
    link = sa.table("report_link", sa.column("id"), sa.column("maker_id"))
    log = sa.table("audit", sa.column("action"), sa.column("user_id"), sa.column("detail", sa.JSON))
    user = sa.table("user", sa.column("id"))
    c = op.get_bind()
    made = sa.select(log.c.user_id, log.c.detail).join(user, user.c.id == log.c.user_id)
    for user_id, detail in c.execute(made.where(log.c.action == "report_link.made")).all():
        of_row = link.c.id == (detail or {}).get("link_id")
        c.execute(sa.update(link).where(of_row).values(maker_id=user_id))


def downgrade() -> None:
    with op.batch_alter_table("report_link", recreate=rebuild()) as batch:
        batch.drop_constraint(op.f("fk_report_link_maker_id_user"), type_="foreignkey")
        batch.drop_column("maker_id")
