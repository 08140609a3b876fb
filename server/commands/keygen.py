"""`sagittal keygen`: create a key for encrypted backups."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def keygen(path: Annotated[Path, Parameter(metavar="FILE")], /) -> int:
    """Write a new key pair; 1 if the file exists."""
    from sagittal.server.storage.archive import BackupFileError, make_key

    try:
        public = make_key(path.absolute())
    except BackupFileError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(
        f"{path} holds the clinic's key. Without it no encrypted backup can be read: keep a copy on paper, "
        f"away from the backups.\nPublic key, which only encrypts: {public}\n"
    )
    sys.stdout.flush()
    return 0
