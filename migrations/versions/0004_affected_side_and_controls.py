"""Which side of a patient is affected, and who serves as a healthy control."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    with op.batch_alter_table("patient") as batch:
        batch.add_column(sa.Column("affected_side", sa.String(length=8), nullable=True))
        batch.add_column(sa.Column("is_control", sa.Boolean(), nullable=False, server_default=sa.false()))
        batch.create_check_constraint(op.f("ck_patient_affected_side"), "affected_side IN ('left', 'right')")


def downgrade() -> None:
    with op.batch_alter_table("patient") as batch:
        batch.drop_constraint(op.f("ck_patient_affected_side"), type_="check")
        batch.drop_column("is_control")
        batch.drop_column("affected_side")
