"""Uncertainty of squat angles: sensitivity to single body and sensor parameters."""

from __future__ import annotations

from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import jobs
from sagittal.server.context import Blobs, Db, Id
from sagittal.server.jobs.queue import SENSITIVITY
from sagittal.server.pages.job_views import view_job
from sagittal.server.pages.results.session_context import read_context
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.report.view.sensitivity import view_sensitivity
from sagittal.server.results import analyses, sensitivities
from sagittal.server.uploads import reference_files

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

STAGES: Final = (
    ("analysis", "Analyse the trial as before"),
    ("parameters", "Perturb 24 inputs, one at a time"),
)
"""Stages of a sensitivity analysis, in words."""


@router.get("/sessions/{sid}/sensitivity")
def show_sensitivity(
    request: Request,
    db: Db,
    blobs: Blobs,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_RESULT)],
    run: Annotated[str | None, Query(max_length=100)] = None,
    show: Annotated[str, Query(max_length=20)] = "step",
) -> Response:
    """Start a sensitivity analysis, follow its progress, view its tables.

    Parameters
    ----------
    run : analysis to show, default the newest. show : change per step, per fraction of the nominal value, or
        in %.
    """
    with db.read() as c:
        context = read_context(c, sid)
        context |= list_choices(c, sid)
        rows = sensitivities.of_session(c, sid)
        selected = next((r for r in rows if r.id == run), rows[0] if rows else None)
        stored = None if selected is None else sensitivities.find_file(c, selected)
    context |= {"runs": rows, "run": selected}
    if selected is not None and stored is not None:
        analysis, name = stored
        context["view"] = view_sensitivity(analyses.file_bytes(blobs, analysis, name), show)
        context["earlier"] = context["analysed"] != analysis.id
        context["csv"] = f"/api/v1/analyses/{analysis.id}/files/{quote(selected.files[1])}"
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "sensitivity.html", "patients", **context)


def list_choices(c: Connection, session_id: str) -> dict[str, Any]:
    """Options of the form, and the running or last failed job."""
    newest = next(iter(jobs.of_session(c, session_id, kind=SENSITIVITY)), None)
    analysed = analyses.latest(c, session_id)
    names = [f.name for f in reference_files.list_files(c, session_id)]
    return {
        "analysed": None if analysed is None else analysed.id,
        "references": [name for name in names if name.lower().endswith(sensitivities.TABLE)],
        "work": None if newest is None else view_job(newest),
        "work_stages": STAGES,
        "view": None,
    }
