"""Security keys beside the password, and accounts that take no codes of an authenticator."""

import sqlalchemy as sa
from alembic import op

from sagittal.server.storage.migration_steps import rebuild

revision = "0018"
down_revision = "0017"


def upgrade() -> None:
    op.create_table(
        "security_key",
        sa.Column("id", sa.String(length=32), nullable=False),
        sa.Column("user_id", sa.String(length=32), nullable=False),
        sa.Column("name", sa.String(length=40), nullable=False),
        sa.Column("host", sa.String(length=255), nullable=False),
        sa.Column("credential_id", sa.LargeBinary(), nullable=False),
        sa.Column("public_key", sa.LargeBinary(), nullable=False),
        sa.Column("sign_count", sa.Integer().with_variant(sa.BigInteger(), "postgresql"), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("used_at", sa.DateTime(timezone=True), nullable=True),
        sa.ForeignKeyConstraint(
            ["user_id"], ["user.id"], name=op.f("fk_security_key_user_id_user"), ondelete="RESTRICT"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_security_key")),
        sa.UniqueConstraint("credential_id", name=op.f("uq_security_key_credential_id")),
    )
    op.create_index(op.f("ix_security_key_user_id"), "security_key", ["user_id"], unique=False)
    op.create_table(
        "security_key_challenge",
        sa.Column("challenge_sha256", sa.String(length=64), nullable=False),
        sa.Column("user_id", sa.String(length=32), nullable=False),
        sa.Column("purpose", sa.String(length=16), nullable=False),
        sa.Column("expires_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint(
            "purpose IN ('register', 'sign_in')", name=op.f("ck_security_key_challenge_purpose")
        ),
        sa.ForeignKeyConstraint(
            ["user_id"], ["user.id"], name=op.f("fk_security_key_challenge_user_id_user"), ondelete="RESTRICT"
        ),
        sa.PrimaryKeyConstraint("challenge_sha256", name=op.f("pk_security_key_challenge")),
    )
    op.create_index(
        op.f("ix_security_key_challenge_user_id"), "security_key_challenge", ["user_id"], unique=False
    )
    with op.batch_alter_table("second_factor", recreate=rebuild()) as batch:
        batch.add_column(sa.Column("keys_only", sa.Boolean(), server_default=sa.false(), nullable=False))


def downgrade() -> None:
    with op.batch_alter_table("second_factor", recreate=rebuild()) as batch:
        batch.drop_column("keys_only")
    op.drop_table("security_key_challenge")
    op.drop_table("security_key")
