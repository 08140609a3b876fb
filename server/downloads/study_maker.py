"""Study downloads: each is built by its own process, one at a time."""

from __future__ import annotations

from typing import Final

import msgspec

from sagittal.core.user_text import encode_user_text
from sagittal.server.auth.identity import Identity
from sagittal.server.downloads.studies import StudyChoice, check_size, list_visits
from sagittal.server.downloads.study_child import StudyReply
from sagittal.server.errors import Conflict, ServiceError
from sagittal.server.processes.child import FAR_BEHIND
from sagittal.server.processes.errand import ErrandTurn, TooManyErrands, run_errand
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database

CHILD: Final = "sagittal.server.downloads.study_child"
LONGEST_S: Final = 300.0
"""Time limit; the maximum number of visits takes some ten seconds."""

_turn = ErrandTurn()


class StudyFailed(ServiceError):  # noqa: N818 - says what failed
    """The tables could not be created."""

    status = 503


def fetch_study(
    db: Database, settings: Settings, user: Identity, choice: StudyChoice
) -> tuple[bytes, tuple[str, ...]]:
    """Tables of a selection as a zip, and the visits they contain.

    Raises
    ------
    Conflict
        no_visits, too_many_visits. StudyFailed: the queue is full, it timed out, or the process died.
    """
    with db.read() as c:
        check_size(list_visits(c, user, choice))
    order = msgspec.msgpack.encode((user, choice), enc_hook=encode_user_text)
    try:
        with _turn.take():
            answer = run_errand(CHILD, settings, order, LONGEST_S, FAR_BEHIND)
    except TooManyErrands as error:
        raise StudyFailed("busy", "Other studies are being made. Try again in a minute.") from error
    except TimeoutError as error:
        raise StudyFailed(
            "study_failed", f"The tables were not made within {LONGEST_S:.0f} s. Choose fewer visits."
        ) from error
    except (EOFError, OSError) as error:
        raise StudyFailed(
            "study_failed", "The process that makes the tables has ended. Choose fewer visits."
        ) from error
    reply = msgspec.msgpack.decode(answer, type=StudyReply)
    if reply.code in {"no_visits", "too_many_visits"}:  # changed since it was checked
        raise Conflict(reply.code, reply.message)
    if reply.code:
        raise StudyFailed(reply.code, reply.message)
    return reply.content, reply.visits
