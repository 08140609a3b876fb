"""Comparisons of orientation filters, and the references they are held against."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"


def upgrade() -> None:
    op.create_table(
        "reference_file",
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("name", sa.String(length=500), nullable=False),
        sa.Column("size", sa.Integer().with_variant(sa.BigInteger(), "postgresql"), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("added_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint("size >= 0", name=op.f("ck_reference_file_size")),
        sa.ForeignKeyConstraint(
            ["session_id"],
            ["session.id"],
            name=op.f("fk_reference_file_session_id_session"),
            ondelete="RESTRICT",
        ),
        sa.PrimaryKeyConstraint("session_id", "name", name=op.f("pk_reference_file")),
    )
    op.create_index(op.f("ix_reference_file_sha256"), "reference_file", ["sha256"], unique=False)
    op.create_table(
        "filter_run",
        sa.Column("id", sa.String(length=32), nullable=False),
        sa.Column("analysis_id", sa.String(length=32), nullable=False),
        sa.Column("job_id", sa.String(length=32), nullable=False),
        sa.Column("settings", sa.JSON(), nullable=False),
        sa.Column("reference_name", sa.String(length=500), nullable=True),
        sa.Column("reference_sha256", sa.String(length=64), nullable=True),
        sa.Column("code_version", sa.String(length=64), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["analysis_id"],
            ["analysis.id"],
            name=op.f("fk_filter_run_analysis_id_analysis"),
            ondelete="RESTRICT",
        ),
        sa.ForeignKeyConstraint(
            ["job_id"], ["job.id"], name=op.f("fk_filter_run_job_id_job"), ondelete="RESTRICT"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_filter_run")),
        sa.UniqueConstraint("job_id", name=op.f("uq_filter_run_job_id")),
    )
    op.create_index(op.f("ix_filter_run_analysis_id"), "filter_run", ["analysis_id"], unique=False)
    op.create_table(
        "filter_run_file",
        sa.Column("filter_run_id", sa.String(length=32), nullable=False),
        sa.Column("name", sa.String(length=100), nullable=False),
        sa.Column("size", sa.Integer().with_variant(sa.BigInteger(), "postgresql"), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.CheckConstraint("size >= 0", name=op.f("ck_filter_run_file_size")),
        sa.ForeignKeyConstraint(
            ["filter_run_id"],
            ["filter_run.id"],
            name=op.f("fk_filter_run_file_filter_run_id_filter_run"),
            ondelete="RESTRICT",
        ),
        sa.PrimaryKeyConstraint("filter_run_id", "name", name=op.f("pk_filter_run_file")),
    )
    op.create_index(op.f("ix_filter_run_file_sha256"), "filter_run_file", ["sha256"], unique=False)


def downgrade() -> None:
    op.drop_table("filter_run_file")
    op.drop_table("filter_run")
    op.drop_table("reference_file")
