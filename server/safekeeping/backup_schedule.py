"""Scheduled backups, and a weekly restore test of the newest one.

if is_due(settings, now()): run(settings)      # in a separate process (worker/backing_up.py)
read_state(settings)                           # last outcomes, for the System page, health and metrics
"""

from __future__ import annotations

import datetime as dt
import json
import logging
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from sagittal.core.formats.json_tree import read_json
from sagittal.server.safekeeping.backups import BackupError, list_backups, make_backup, prune
from sagittal.server.safekeeping.restore_room import RestoreError
from sagittal.server.safekeeping.restoring import try_restore
from sagittal.server.safekeeping.tombstones import TombstoneError
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.archive import BackupFileError, ClinicKey, read_key
from sagittal.server.storage.db import Database
from sagittal.server.storage.migrate import MigrationError, require_current
from sagittal.server.storage.schema.tables import now

log = logging.getLogger(__name__)

TEST_EVERY: Final = dt.timedelta(days=7)
"""Maximum age of the last restore test."""
TRY_AGAIN: Final = dt.timedelta(hours=1)
"""Pause after a failed backup or test."""
LATE: Final = dt.timedelta(hours=26)
"""Age of the newest backup from which a warning is issued."""

NOT_TESTED: Final = (
    "It is encrypted for a key that is not on this computer. Try it where the key is: "
    "sagittal restore FILE --key FILE --test."
)

LEFT_OUT: Final = (
    "The key of patients' names is not in it: it is not encrypted, or the key cannot be read. "
    "Keep a copy on paper."
)
CLOSED: Final = "Patients' names in it need their key, which is not in it or is another one."


@dataclass(frozen=True)
class Outcome:
    """Outcome of one backup or restore test.

    Parameters
    ----------
    at : end time. ok : None = it could not be attempted. name : the backup's file.
    said : error or findings, as a sentence. size : bytes of the backup, 0 = none.
    """

    at: dt.datetime
    ok: bool | None
    name: str
    said: str
    size: int = 0


@dataclass(frozen=True)
class BackupState:
    """Outcome of the last backup and restore test; None = there was none.

    Parameters
    ----------
    good : the last backup without errors.
    """

    backup: Outcome | None = None
    good: Outcome | None = None
    test: Outcome | None = None


def read_state(settings: Settings) -> BackupState:
    """Read the state file; empty if missing or unreadable."""
    try:
        tree: Any = read_json(settings.backup_state.read_bytes())
        return BackupState(*(_parse(tree[name]) for name in ("backup", "good", "test")))
    except FileNotFoundError:
        return BackupState()
    except (OSError, ValueError, KeyError, TypeError):
        log.exception("%s cannot be read", settings.backup_state.name)
        return BackupState()


def next_time(settings: Settings, time: dt.datetime) -> dt.datetime:
    """Next occurrence of `backup_at`, in the time zone of `time`."""
    hour, minute = map(int, settings.backup_at.split(":"))
    day = time.replace(hour=hour, minute=minute, second=0, microsecond=0)
    return day if day > time else day + dt.timedelta(days=1)


def is_due(settings: Settings, time: dt.datetime) -> bool:
    """Whether a backup is due: none since the last `backup_at`, and no failure within the hour.

    Parameters
    ----------
    time : local time.
    """
    if not settings.backup_dir:
        return False
    state = read_state(settings)
    if state.backup is not None and not state.backup.ok and time - state.backup.at < TRY_AGAIN:
        return False
    last = next_time(settings, time) - dt.timedelta(days=1)
    return state.good is None or state.good.at < last


def run(settings: Settings) -> BackupState:
    """Make a backup, prune old ones, test the newest if the last test is a week old, and store the
    outcome.
    """
    folder = Path(settings.backup_dir)
    state = read_state(settings)
    key: ClinicKey | None = None
    try:
        require_current(settings.database_source)
        key = read_key(Path(settings.backup_key)) if settings.backup_key else None
        with closing(Database(settings.database_source)) as db:
            new_backup = make_backup(db, settings, folder, key)
        prune(folder)
        message = ""
        if new_backup.left_out is not None:
            message = LEFT_OUT
        if new_backup.missing:
            message = f"{len(new_backup.missing)} stored files are gone or damaged; see sagittal check."
        backup = Outcome(now(), not new_backup.missing, new_backup.path.name, message, new_backup.size)
    except (BackupFileError, BackupError, MigrationError, TombstoneError, OSError) as error:
        log.error("no backup was made: %s", error)
        backup = Outcome(now(), False, "", str(error))
    good = backup if backup.size else state.good
    state = _write(settings, BackupState(backup, good, state.test))
    if backup.size and _is_test_due(state):
        state = _write(settings, replace(state, test=_test(settings, folder, key)))
    return state


def _is_test_due(state: BackupState) -> bool:
    if state.test is None or state.test.ok is None:
        return True
    return now() - state.test.at >= (TEST_EVERY - TRY_AGAIN if state.test.ok else TRY_AGAIN)


def _test(settings: Settings, folder: Path, key: ClinicKey | None) -> Outcome:
    newest = list_backups(folder)[0].path
    if key is not None and not key.opens:
        return Outcome(now(), None, newest.name, NOT_TESTED)
    try:
        restored = try_restore(newest, settings, key)
    except (BackupFileError, RestoreError, TombstoneError) as error:
        log.error("the newest backup could not be restored: %s", error)
        return Outcome(now(), False, newest.name, str(error))
    message = f"{restored.patients} patients, {restored.sessions} visits, {restored.files} files."
    if restored.names_open:
        return Outcome(now(), True, newest.name, message)
    # unencrypted backups never contain the key; encrypted ones should
    return Outcome(now(), key is None, newest.name, f"{message} {CLOSED}")


def _parse(tree: Any) -> Outcome | None:
    if tree is None:
        return None
    time = dt.datetime.fromisoformat(tree["at"])
    return Outcome(time, tree["ok"], tree["name"], tree["said"], tree["size"])


def _write(settings: Settings, state: BackupState) -> BackupState:
    def tree(one: Outcome | None) -> object:
        return None if one is None else {**one.__dict__, "at": one.at.isoformat()}

    content = {"backup": tree(state.backup), "good": tree(state.good), "test": tree(state.test)}
    fs.write_file(settings.backup_state, json.dumps(content).encode())
    return state
