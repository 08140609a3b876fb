"""Tables of several web servers on one database, emptied by a restore; for conventions see tables.py."""

from __future__ import annotations

from sqlalchemy import CheckConstraint, Column, Index, Integer, String, Table, Text

from sagittal.server.storage.schema.columns import UserString, Utc, id_column, metadata

web_node = Table(
    "web_node",
    metadata,
    Column("name", UserString(32), primary_key=True),
    Column("address", UserString(300), nullable=False),  # address for the other nodes
    Column("key_sha256", String(64), nullable=False),  # of the key in the shared data folder
    Column("run", Integer, nullable=False),  # number of its start; earlier ones are fenced off
    Column("started_at", Utc, nullable=False),
    Column("beat_at", Utc),  # None: stopped
    CheckConstraint("run >= 1", name="run"),
)

failed_attempt = Table(
    # failed sign-ins of an account, an address or both; stored where several nodes count together
    "failed_attempt",
    metadata,
    id_column(),
    Column("account", Text),
    Column("address", Text),
    Column("at", Utc, nullable=False, index=True),
)
Index("ix_failed_attempt_key", failed_attempt.c.account, failed_attempt.c.address, failed_attempt.c.at)
