"""`sagittal check`: verify the integrity of all stored data."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def check(*, head: Annotated[Path | None, Parameter(metavar="JSON")] = None, data_dir: DataDir = None) -> int:
    """Check database, stored files, live logs, trash, audit chain, encrypted values; 1 on any problem.

    Parameters
    ----------
    head
        copy of the newest audit row, saved elsewhere
    """
    from sagittal.server.safekeeping import checks
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.files.blob_opening import open_blobs
    from sagittal.server.storage.migrate import MigrationError, require_current

    settings = load_settings({"data_dir": data_dir})
    try:
        require_current(settings.database_source)
    except MigrationError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    with closing(Database(settings.database_source)) as db:
        findings = checks.check(db, open_blobs(settings), settings, kept_head=head)
    for finding in findings:
        sys.stdout.write(f"{finding.area}: {finding.message}\n")
    sys.stdout.write(
        f"{len(findings)} problem{'s' * (len(findings) > 1)} in {settings.data_dir}\n"
        if findings
        else "All is well.\n"
    )
    sys.stdout.flush()
    return 1 if findings else 0
