"""Selects the queue implementation for a database."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable

from sagittal.server.jobs.table import TableQueue
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import now


def open_queue(db: Database, lease_s: float, clock: Callable[[], dt.datetime] = now) -> TableQueue:
    """Queue of a database: with deliveries on PostgreSQL, otherwise with polling."""
    if isinstance(db.source, str):
        from sagittal.server.jobs.delivered import DeliveredQueue  # an optional dependency

        return DeliveredQueue(db, lease_s, clock)
    return TableQueue(db, lease_s, clock)
