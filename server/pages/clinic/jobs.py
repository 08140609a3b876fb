"""Current and past computations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import jobs
from sagittal.server.context import Db
from sagittal.server.pages.job_views import follow_few, view_job
from sagittal.server.pages.shell import record_listing, render_page
from sagittal.web.words import seconds

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

JOBS_SHOWN: Final = 100

JOB_WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "queued": ("none", "Waiting"),
    "running": ("run", "Running"),
    "done": ("ok", "Done"),
    "failed": ("bad", "Failed"),
    "cancelled": ("none", "Cancelled"),
}

KIND_WORDS: Final = {
    "inspect": "Reading the files",
    "analyse": "Analysis",
    "compare_filters": "Comparison of filters",
    "tune": "Tuning of a filter",
    "sensitivity": "Sensitivity of squats",
    "export": "Export file",
}


@router.get("/jobs")
def show_jobs(request: Request, db: Db, user: Annotated[Identity, require(Action.READ_JOB)]) -> Response:
    """Current and past computations."""
    with db.read() as c:
        rows = list_jobs(c, user)
    record_listing(request, user, "job")
    return render_page(request, db, user, "jobs.html", "jobs", jobs=rows)


def list_jobs(c: Connection, user: Identity) -> list[dict[str, Any]]:
    """Latest jobs that a user may see, with their visits."""
    rows = []
    for view in jobs.list_jobs(c, user, limit=JOBS_SHOWN):
        shape, word = JOB_WORDS[view.state]
        ended = view.started_at and view.finished_at
        visit = {"id": view.session_id, "code": view.patient_code, "title": view.session_title}
        rows.append(
            view_job(view)
            | {
                "shape": shape,
                "word": word,
                "what": KIND_WORDS.get(view.kind, view.kind),
                "took": seconds((view.finished_at - view.started_at).total_seconds()) if ended else None,  # type: ignore[operator]
                "session": visit if view.session_id else None,
            }
        )
    follow_few(rows)
    return rows
