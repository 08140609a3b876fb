"""Audit trail: append-only rows chained by hash, written in the transaction of the change.

    with db.write() as c:
        c.execute(...)
        audit.record(c, actor, "patient.renamed", "patient", pid, {"fields": ["code"]})

Rows for read access go through server/trail.py. One row per opened or changed resource; `detail` never
contains a patient's code or name, as it outlives an erasure. Triggers forbid UPDATE and DELETE; bypassing
them breaks the chain, which `sagittal check` detects.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
from collections.abc import Mapping
from typing import Any, Protocol

from sqlalchemy import Connection, Row, insert, select

from sagittal.server.storage.db import highest_number
from sagittal.server.storage.schema.tables import audit, now

GENESIS = "0" * 64
"""Previous hash of the first row."""


class Actor(Protocol):
    """A signed-in user who performs an action."""

    @property
    def user_id(self) -> str:
        """Primary key in `user`."""

    @property
    def name(self) -> str:
        """Sign-in name at that time."""


def record(
    c: Connection,
    actor: Actor | None,
    action: str,
    resource: str,
    resource_id: str | None,
    detail: Mapping[str, Any] | None = None,
    *,
    time: dt.datetime | None = None,
) -> None:
    """Append one row on a writing connection; actor None = the system, at None = now."""
    token = getattr(actor, "token_id", None)  # user of an API token (server/auth/identity.py)
    last = c.execute(select(audit.c.seq, audit.c.hash).order_by(audit.c.seq.desc()).limit(1)).first()
    row = {
        "seq": 1 if last is None else last.seq + 1,
        "at": time or now(),
        "user_id": actor.user_id if actor else None,
        "user_name": actor.name if actor else None,
        "action": action,
        "resource": resource,
        "resource_id": resource_id,
        "detail": dict(detail or {}) | ({} if token is None else {"token": token}),
        "previous": GENESIS if last is None else last.hash,
    }
    c.execute(insert(audit).values(**row, hash=_seal(row)))


def list_entries(c: Connection, *, before_seq: int | None = None, limit: int = 100) -> list[Row[Any]]:
    """The newest rows, or the newest before a sequence number (for paging)."""
    query = select(audit).order_by(audit.c.seq.desc()).limit(limit)
    return list(c.execute(query if before_seq is None else query.where(audit.c.seq < before_seq)))


def find_problems(c: Connection) -> list[str]:
    """Breaks in the chain: changed or removed rows, or a truncated beginning or end.

    A database replaced as a whole by an older copy is detected by storage/high_water.py instead.
    """
    problems = []
    expected, previous = 1, GENESIS
    for row in c.execute(select(audit).order_by(audit.c.seq)):
        if row.seq != expected:
            problems.append(f"audit rows {expected} to {row.seq - 1} have been removed")
        elif row.previous != previous:
            problems.append(f"audit row {row.seq} does not follow the row before it")
        if _seal(row._asdict()) != row.hash:
            problems.append(f"audit row {row.seq} has been changed")
        expected, previous = row.seq + 1, row.hash
    highest = highest_number(c, audit.name)
    if highest >= expected:
        problems.append(f"audit rows {expected} to {highest}, the newest, have been removed")
    return problems


def _seal(row: Mapping[str, Any]) -> str:
    """SHA-256 over every column except the hash, as canonical JSON."""
    content = {k: v.astimezone(dt.UTC).isoformat() if k == "at" else v for k, v in row.items() if k != "hash"}
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
