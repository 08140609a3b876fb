"""List of erased patients and sessions, stored with the backups, so that restores exclude them.

Every backup contains the list at its time; `erased.json` in the backup folder is updated within a minute of
an erasure and only grows. It contains random ids and no personal data.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Connection, select

from sagittal.core.formats.json_tree import read_json
from sagittal.server.safekeeping.erasure import ERASED, SESSION_ERASED
from sagittal.server.storage import fs
from sagittal.server.storage.schema.tables import audit

NAME: Final = "erased.json"


class TombstoneError(Exception):
    """The list exists but cannot be read; the message names the file."""


@dataclass(frozen=True)
class Tombstones:
    """Ids of erased patients and sessions."""

    patients: frozenset[str] = frozenset()
    sessions: frozenset[str] = frozenset()

    def __or__(self, operand: Tombstones) -> Tombstones:
        return Tombstones(self.patients | operand.patients, self.sessions | operand.sessions)

    def tree(self) -> dict[str, list[str]]:
        """Convert to JSON."""
        return {"patients": sorted(self.patients), "sessions": sorted(self.sessions)}


def find_tombstones(c: Connection) -> Tombstones:
    """All erased patients and sessions according to the audit log."""
    rows = c.execute(
        select(audit.c.action, audit.c.resource_id).where(audit.c.action.in_((ERASED, SESSION_ERASED)))
    ).all()
    return Tombstones(
        frozenset(row.resource_id for row in rows if row.action == ERASED),
        frozenset(row.resource_id for row in rows if row.action == SESSION_ERASED),
    )


def parse_tombstones(tree: Any) -> Tombstones:
    """Parse the result of `tree`; raises ValueError."""
    try:
        return Tombstones(
            frozenset(str(one) for one in tree["patients"]), frozenset(str(one) for one in tree["sessions"])
        )
    except (KeyError, TypeError) as error:
        raise ValueError("no list of erased patients and sessions") from error


def read_tombstones(path: Path) -> Tombstones:
    """Read the list from a file, empty if it does not exist; raises TombstoneError."""
    try:
        return parse_tombstones(read_json(path.read_bytes()))
    except FileNotFoundError:
        return Tombstones()
    except (ValueError, OSError) as error:
        raise TombstoneError(
            f"{path} cannot be read ({error}). It says who must not come back; put back a copy of it."
        ) from error


def keep_tombstones(erased: Tombstones, folder: Path) -> None:
    """Add to the list in a backup folder; nothing is written if all are included."""
    path = folder / NAME
    stored = read_tombstones(path)
    if not path.exists() or stored | erased != stored:
        fs.write_file(path, json.dumps((stored | erased).tree()).encode())
