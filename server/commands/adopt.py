"""`sagittal adopt`: live recordings missing from the database; assign one to a session."""

from __future__ import annotations

import sys
from contextlib import closing

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import Settings, load_settings


def adopt(take: str | None = None, /, *, session: str | None = None, data_dir: DataDir = None) -> int:
    """List the logs, or make `take` a recording of `session`; 1 if that is not possible.

    Parameters
    ----------
    take
        id of a listed log
    session
        the session's URL or id
    """
    from sagittal.server.errors import ServiceError
    from sagittal.server.storage.migrate import MigrationError, require_current

    settings = load_settings({"data_dir": data_dir})
    if (take is None) != (session is None):
        sys.stderr.write("Give both a take and --session, or neither to list what can be adopted.\n")
        return 2
    try:
        require_current(settings.database_source)
        if take is None or session is None:
            return _list(settings)
        return _adopt(settings, take, session.rstrip("/").rsplit("/", 1)[-1])
    except (MigrationError, ServiceError) as error:
        sys.stderr.write(f"{error}\n")
        return 1


def _list(settings: Settings) -> int:
    from sagittal.server.live_takes import live_logs
    from sagittal.server.storage.db import Database

    with closing(Database(settings.database_source)) as db, db.read() as c:
        strangers = [log for log in live_logs.list_logs(c, settings) if not log.known]
    for log in strangers:
        sys.stdout.write(f"{log.take_id}  {log.words}\n")
    sys.stdout.write(
        "Give one to a session: sagittal adopt TAKE --session ADDRESS-OF-ITS-PAGE\n"
        if strangers
        else "The database knows every live recording.\n"
    )
    sys.stdout.flush()
    return 0


def _adopt(settings: Settings, take: str, session: str) -> int:
    from sagittal.server.jobs.opening import open_queue
    from sagittal.server.live_takes import live_logs
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.files.blob_opening import open_blobs

    with closing(Database(settings.database_source)) as db:
        queue = open_queue(db, settings.lease_s)
        live_logs.adopt(db, open_blobs(settings), settings, queue, None, take, session)
    sys.stdout.write(f"It is the newest recording of /sessions/{session} now and will be analysed.\n")
    sys.stdout.flush()
    return 0
