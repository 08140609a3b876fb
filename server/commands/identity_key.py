"""`sagittal identity-key`: the key that encrypts names and addresses of patients."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path
from typing import Literal

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def identity_key(
    what: Literal["make", "change", "discard"],
    /,
    *,
    really: bool = False,
    without_key: bool = False,
    data_dir: DataDir = None,
) -> int:
    """Create the key, change it, or list and remove identities it cannot decrypt; 1 if not possible.

    Parameters
    ----------
    what
        discard: list identities it cannot decrypt
    really
        permanently delete what `discard` lists
    without_key
        even if the key is missing: they are lost permanently
    """
    from sagittal.core.errors import SagittalError
    from sagittal.server.clinic import identities
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.migrate import MigrationError, require_current

    settings = load_settings({"data_dir": data_dir})
    file = settings.identity_key_file
    try:
        require_current(settings.database_source)
        with closing(Database(settings.database_source)) as db:
            if what == "make":
                message = _tell_made(file, identities.make_key(db, file))
            elif what == "change":
                name, count = identities.change_key(db, file)
                message = (
                    f"{count} patients' names are encrypted by key {name} now. Keep a copy of {file} on "
                    "paper. The old copy is needed for unencrypted backups from before.\n"
                )
            else:
                gone = identities.discard_unreadable(db, file, really=really, without_key=without_key)
                message = "".join(f"patient {one}\n" for one in gone)
                message += f"{len(gone)} patients' names cannot be read with {file}"
                if not gone:
                    message += ".\n"
                else:
                    message += " and were removed.\n" if really else "; --really removes them for good.\n"
    except (MigrationError, SagittalError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(message)
    sys.stdout.flush()
    return 0


def _tell_made(file: Path, name: str) -> str:
    return (
        f"{file} holds the key {name} of patients' names. Without it no name can be read: keep a copy on "
        "paper. Encrypted backups hold it too, others do not.\n"
    )
