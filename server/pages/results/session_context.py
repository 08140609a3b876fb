"""Common context of all pages of a session: visit, patient, latest job, live trial."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import Connection
from starlette.responses import RedirectResponse

from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.sessions import Session
from sagittal.server.live_takes import live, live_events
from sagittal.server.pages.job_views import find_newest_job, view_job
from sagittal.server.pages.words import TEST_NAMES
from sagittal.server.results import analyses, controls

STAGE_NAMES: Final[Mapping[str, str]] = {
    "reading": "Read the files",
    "timeline": "Synchronise all sensors",
    "agreement": "Check sensor clocks and placement",
    "quality": "Check the data",
    "calibration": "Calibrate sensor-to-segment alignment",
    "orientation": "Estimate the orientation of each segment",
    "events": "Detect contacts and strides",
    "mounting": "Align the sensors at shared joints",
    "poses": "Build the avatar",
    "angles": "Compute joint angles",
    "parameters": "Compute parameters",
}
"""Stages of an analysis in order → description. sagittal.core.pipeline itself takes seconds to import."""

STAGES_OF_DAYS: Final[Mapping[str, str]] = {
    "reading": "Read the files",
    "activity": "Process the days",
    "quality": "Check the data",
}
"""Likewise for daily life."""


def read_context(c: Connection, session_id: str) -> dict[str, Any]:
    """Session, patient, recording and latest job, required by every page of a session."""
    session = sessions.get(c, session_id)
    patient = patients.get(c, session.patient_id)
    job = find_newest_job(c, session_id)
    take = live.current(c, session_id)
    return {
        "session": session,
        "patient": patient,
        "curves": _may_have_curves(c, session),
        "recording": session.state != "empty",
        "job": None if job is None else view_job(job),
        "stages": list((STAGES_OF_DAYS if session.protocol == "activity" else STAGE_NAMES).items()),
        "live_now": take.state if take is not None and take.is_open else None,
        "damages": live_events.list_damages(c, session_id),
        "report": None,
    }


def read_measured_context(c: Connection, session_id: str) -> dict[str, Any]:
    """Context with the clinic's controls, for pages that compare with them."""
    context = read_context(c, session_id)
    return context | {"controls": controls.list_visits(c, context["patient"], context["session"])}


def _may_have_curves(c: Connection, session: Session) -> bool:
    """Whether pages of cycle curves and filters have content, now or after analysis.

    Squats have separate curves, and of a test often only times are measured.
    """
    if session.protocol == "squat":
        return False
    if session.protocol not in TEST_NAMES:
        return True
    analysed = analyses.latest(c, session.id)
    return analysed is not None and "angles.parquet" in analysed.files


def lead_to_days(context: Mapping[str, Any]) -> RedirectResponse | None:
    """Redirect from pages of strides, curves, calibration and filters to the days of a daily-life
    recording.
    """
    session = context["session"]
    if session.protocol != "activity":
        return None
    return RedirectResponse(f"/sessions/{session.id}#h-days", status_code=303)
