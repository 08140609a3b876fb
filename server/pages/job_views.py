"""Jobs as the templates take them, and which of them a page follows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, Final

from sqlalchemy import Connection

from sagittal.server.clinic import jobs
from sagittal.server.jobs.queue import BESIDE, JobView

FOLLOWED: Final = 3


def view_job(view: JobView) -> dict[str, Any]:
    """A job for the templates: `active` = will still change; `live` = the page follows it."""
    return {**vars(view), "active": not view.finished, "live": not view.finished}


def follow_few(found: Sequence[dict[str, Any] | None]) -> None:
    """Follow the first jobs of a list only: each takes one of the six connections a browser has."""
    active = [j for j in found if j is not None and j["active"]]
    active.sort(key=lambda j: j["state"] != "running")
    for j in active[FOLLOWED:]:
        j["live"] = False


def find_newest_job(c: Connection, session_id: str) -> JobView | None:
    """The job a session's pages speak of."""
    return next((view for view in jobs.of_session(c, session_id) if view.kind not in BESIDE), None)


def find_active_jobs(
    c: Connection, patient_ids: Collection[str], whose: Callable[[jobs.ListedJob], str | None]
) -> dict[str | None, dict[str, Any]]:
    """The running job of these patients, else the newest that waits, by what `whose` takes of it.

    Not of others: as many as one likes may wait.
    """
    found: dict[str | None, dict[str, Any]] = {}
    for listed in jobs.list_active(c, patient_ids):
        if listed.kind in BESIDE:
            continue
        found.setdefault(whose(listed), view_job(listed))
    return found
