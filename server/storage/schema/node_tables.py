"""Tables of several web servers on one database, emptied by a restore; for conventions see tables.py."""

from __future__ import annotations

from sqlalchemy import CheckConstraint, Column, Index, Integer, String, Table, Text

from sagittal.server.storage.schema.columns import UserString, Utc, id_column, metadata

web_node = Table(
    "web_node",
    metadata,
    Column("name", UserString(32), primary_key=True),
    Column("address", UserString(300), nullable=False),  # where the other nodes reach it
    Column("key_sha256", String(64), nullable=False),  # of the key in the data folder: all of them share that
    Column("run", Integer, nullable=False),  # which of its starts; an earlier one is fenced off
    Column("started_at", Utc, nullable=False),
    Column("beat_at", Utc),  # None: it was stopped
    CheckConstraint("run >= 1", name="run"),
)

failed_attempt = Table(
    "failed_attempt",  # to get in, of an account, an address or both; kept where several nodes count together
    metadata,
    id_column(),
    Column("account", Text),
    Column("address", Text),
    Column("at", Utc, nullable=False, index=True),
)
Index("ix_failed_attempt_key", failed_attempt.c.account, failed_attempt.c.address, failed_attempt.c.at)
