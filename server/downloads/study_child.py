"""Process that builds the tables of one study, so that reading hundreds of results does not block the server.

Started by server/downloads/study_maker.py as `python -m sagittal.server.downloads.study_child <socket>
<parent pid>`. It reads the database and writes nothing.
"""

from __future__ import annotations

import logging
from contextlib import closing

import msgspec

from sagittal.core.errors import SagittalError
from sagittal.core.user_text import encode_user_text
from sagittal.server.auth.identity import Identity
from sagittal.server.downloads.studies import StudyChoice, make_study
from sagittal.server.export.zipping import zip_files
from sagittal.server.processes.child import enter_child
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_opening import open_blobs


class StudyReply(msgspec.Struct, frozen=True):
    """Tables of a study in a zip and its visits, or the reason of failure."""

    content: bytes = b""
    visits: tuple[str, ...] = ()
    code: str = ""
    message: str = ""


def main() -> None:
    """Build the tables of the one request received over the channel."""
    line, settings = enter_child()
    try:
        reply = _make(settings, *msgspec.msgpack.decode(line.receive(), type=tuple[Identity, StudyChoice]))
    except SagittalError as error:
        reply = StudyReply(code=error.code, message=error.message)
    except Exception:
        logging.getLogger(__name__).exception("a study could not be made")
        reply = StudyReply(code="internal_error", message="The tables could not be made; the log says why.")
    line.send(msgspec.msgpack.encode(reply, enc_hook=encode_user_text))


def _make(settings: Settings, user: Identity, choice: StudyChoice) -> StudyReply:
    with closing(Database(settings.database_source)) as db:
        tables, visits = make_study(db, ReviewedAnalyses(open_blobs(settings)), user, choice)
    return StudyReply(zip_files(tables.files), tuple(visits))


if __name__ == "__main__":
    main()
