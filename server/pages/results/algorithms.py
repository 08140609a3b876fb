"""Comparison of orientation filters on a trial: selection, progress and differences."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal
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
from sagittal.server.jobs.queue import COMPARE_FILTERS
from sagittal.server.pages.job_views import view_job
from sagittal.server.pages.results.session_context import lead_to_days, read_context
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.report.view.filter_view import NAME, view_comparison
from sagittal.server.report.words.filter_list import PROPOSED, list_engines
from sagittal.server.results import analyses, filter_runs
from sagittal.server.uploads import reference_files

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

STAGES: Final = (
    ("analysis", "Analyse the trial as before"),
    ("filters", "Run the filters"),
    ("comparing", "Compare them"),
)
"""Stages of a comparison, in words."""

FILE_WORDS: Final = {
    "filters.json": "All content of this page",
    "filters.csv": "Cost and agreement of each filter",
    "spread.csv": "Spread over the trial, in stance and swing",
    "spread_cycle.csv": "Spread over the gait cycle",
    "spread_time.csv": "Spread over time",
    "orientations.parquet": "Orientation of every segment by each filter",
    "reference.csv": "RMSE and Bland–Altman against the reference",
}

Word = Annotated[str | None, Query(max_length=100)]


@router.get("/sessions/{sid}/algorithms")
def show_algorithms(
    request: Request,
    db: Db,
    blobs: Blobs,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_RESULT)],
    run: Word = None,
    over: Literal["cycle", "time"] = "cycle",
    of: Word = None,
    against: Word = None,
) -> Response:
    """Select filters, run them, and view their spread and agreement.

    Parameters
    ----------
    run : comparison to show, default the newest. of : segment or joint angle compared with the reference.
    against : filter to plot.
    """
    with db.read() as c:
        context = read_context(c, sid)
        if elsewhere := lead_to_days(context):
            return elsewhere
        context |= list_choices(c, sid)
        runs = filter_runs.of_session(c, sid)
    selected = next((r for r in runs if r.id == run), runs[0] if runs else None)
    if selected is not None:
        content = filter_runs.file_bytes(blobs, selected, NAME)
        context["view"] = view_comparison(content, over, of, against)
        context["run"] = selected
        context["chosen"] = selected.settings["filters"]
        context["files"] = [
            {"name": name, "what": FILE_WORDS.get(name, ""), "href": _href(selected.id, name)}
            for name in selected.files
        ]
    context["runs"] = runs
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "algorithms.html", "patients", **context)


def list_choices(c: Connection, session_id: str) -> dict[str, Any]:
    """Options of the form, and the running or last failed comparison."""
    newest = next(iter(jobs.of_session(c, session_id, kind=COMPARE_FILTERS)), None)
    return {
        "analysed": analyses.latest(c, session_id) is not None,
        "engines": list_engines(),
        "chosen": PROPOSED,
        "references": reference_files.list_files(c, session_id),
        "work": None if newest is None else view_job(newest),
        "work_stages": STAGES,
        "run": None,
        "view": None,
        "files": [],
    }


def _href(run_id: str, name: str) -> str:
    return f"/api/v1/filter-runs/{run_id}/files/{quote(name)}"
