"""`sagittal worker`: run an additional worker on the data folder of a server."""

from __future__ import annotations

import os
import sys

from sagittal.server.commands.options import DataDir
from sagittal.server.log import start_log
from sagittal.server.settings import load_settings


def worker(*, data_dir: DataDir = None) -> int:
    """Work until SIGTERM or Ctrl-C; 1 if database or folder do not match the server's."""
    from sagittal.server.safekeeping.custody import StrangersError
    from sagittal.server.storage import fs
    from sagittal.server.storage.migrate import MigrationError
    from sagittal.server.worker.worker import run_worker

    settings = load_settings({"data_dir": data_dir})
    start_log(settings)
    os.umask(0o077)
    try:
        run_worker(settings)
    except fs.LockedError as error:
        sys.stderr.write(f"{settings.data_dir} is in use by {error.holder}; start this worker after it.\n")
        return 1
    except (MigrationError, StrangersError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0
