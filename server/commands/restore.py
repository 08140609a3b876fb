"""`sagittal restore`: restore a backup into an empty data folder, or test whether it can be restored."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import Settings, load_settings


def restore(
    archive: Annotated[Path, Parameter(metavar="FILE")],
    /,
    *,
    key: Path | None = None,
    erased: Annotated[Path | None, Parameter(metavar="JSON")] = None,
    test: bool = False,
    data_dir: DataDir = None,
) -> int:
    """Restore a backup after complete verification; 1 if nothing was restored.

    Parameters
    ----------
    key
        the private key of an encrypted backup
    erased
        additional list of erased patients that must not be restored
    test
        only test it, in a temporary folder
    """
    from sagittal.server.safekeeping import restoring
    from sagittal.server.safekeeping.restore_room import RestoreError
    from sagittal.server.safekeeping.tombstones import TombstoneError, read_tombstones
    from sagittal.server.storage.archive import BackupFileError, read_key

    settings = load_settings({"data_dir": data_dir})
    try:
        clinic_key = None if key is None else read_key(key)
        if test:
            restored = restoring.try_restore(archive.absolute(), settings, clinic_key)
        else:
            gone = None if erased is None else read_tombstones(erased)
            restored = restoring.restore(archive.absolute(), settings, clinic_key, gone)
    except (BackupFileError, TombstoneError, RestoreError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(
        f"{'It could be restored' if test else f'Restored into {settings.data_dir}'}: the clinic of "
        f"{restored.created_at:%Y-%m-%d %H:%M}Z, {restored.patients} patients, {restored.sessions} visits, "
        f"{restored.files} files; every hash, the database and the audit chain are right. "
        f"{restored.erased_again} erased again.\n"
    )
    if restored.missing:
        sys.stdout.write(
            f"{restored.missing} files were gone when the backup was made; see `sagittal check`.\n"
        )
    if not restored.names_open:
        sys.stdout.write(
            "The key that opens patients' names was not in the backup. It has to be at "
            f"{settings.identity_key_file}; `sagittal check` says whether it opens them.\n"
        )
    elif not test:
        sys.stdout.write(_tell_names_key(settings))
    sys.stdout.flush()
    return 0


def _tell_names_key(settings: Settings) -> str:
    """Print where to put the identity key from the backup if it belongs outside the data folder."""
    from sagittal.server.safekeeping.backups import IDENTITY_KEY

    came, place = settings.data_dir / IDENTITY_KEY, settings.identity_key_file
    if came == place or not came.is_file():
        return ""
    if place.is_file() and place.read_bytes() != came.read_bytes():
        return (
            f"The key of patients' names lies in {came}; another one is at {place}. Keep that one aside, as "
            "other backups may need it, and put the key of this backup in its place.\n"
        )
    return f"The key of patients' names lies in {came}. Move it to {place}.\n"
