"""Template context of jobs, and selection of those with live updates."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, Final

from sqlalchemy import Connection

from sagittal.server.clinic import jobs
from sagittal.server.jobs.queue import BESIDE, JobView

FOLLOWED: Final = 3


def view_job(view: JobView) -> dict[str, Any]:
    """Template context of a job: `active` = unfinished; `live` = with live updates."""
    return {**vars(view), "active": not view.finished, "live": not view.finished}


def follow_few(views: Sequence[dict[str, Any] | None]) -> None:
    """Enable live updates for the first jobs of a list only, as each uses one of a browser's six
    connections.
    """
    active = [j for j in views if j is not None and j["active"]]
    active.sort(key=lambda j: j["state"] != "running")
    for j in active[FOLLOWED:]:
        j["live"] = False


def find_newest_job(c: Connection, session_id: str) -> JobView | None:
    """The job shown on a session's pages."""
    return next((view for view in jobs.of_session(c, session_id) if view.kind not in BESIDE), None)


def find_active_jobs(
    c: Connection, patient_ids: Collection[str], whose: Callable[[jobs.ListedJob], str | None]
) -> dict[str | None, dict[str, Any]]:
    """Running or otherwise newest queued job of these patients, by the key returned by `whose`.

    Restricted to these patients, as any number of jobs may be queued.
    """
    jobs_by_owner: dict[str | None, dict[str, Any]] = {}
    for listed in jobs.list_active(c, patient_ids):
        if listed.kind in BESIDE:
            continue
        jobs_by_owner.setdefault(whose(listed), view_job(listed))
    return jobs_by_owner
