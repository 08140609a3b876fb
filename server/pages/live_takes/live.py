"""Live pages for therapist and patient; dynamic content arrives through the feed."""

from __future__ import annotations

from typing import Annotated, Any, Final
from urllib.parse import urlsplit

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.context import Db, Id
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.pages.words import PROTOCOL_NAMES, SEGMENT_NAMES
from sagittal.server.report.view.functional import MEANT, norm_words
from sagittal.server.report.words.guided_words import HINTS, TOTAL, tell_person
from sagittal.server.report.words.wording import VARIABLES, ZERO_WORDS, Variable
from sagittal.server.results import prescriptions

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

JOINTS: Final = {"hip_flexion": "Hip", "knee_flexion": "Knee", "ankle_dorsiflexion": "Ankle"}
"""Variables of the current stride → label of the button; sagittal plane only, which is reliable live."""

UNPRESCRIBED: Final = (
    "step_length_m",
    "stride_length_m",
    "stride_time_s",
    "stance_pct",
    "knee_flexion_max_swing_deg",
    "foot_pitch_ic_deg",
)
"""Options of the stride strip without a prescription."""

LOOPBACK: Final = ("127.0.0.1", "::1", "localhost")

Therapist = Annotated[Identity, require(Action.RUN_LIVE)]


@router.get("/sessions/{sid}/live")
def show_live(request: Request, db: Db, sid: Id, user: Therapist) -> Response:
    """Pair the tablet, calibrate, monitor the walk and control the feedback."""
    with db.read() as c:
        session = sessions.get(c, sid)
        patient = patients.get(c, session.patient_id)
        view = view_live(c, session, patient, capture=str(request.base_url) + "capture")
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "live.html", "patients", session=session, patient=patient, **view)


@router.get("/sessions/{sid}/live/patient")
def show_patient_screen(request: Request, db: Db, sid: Id, user: Therapist) -> Response:
    """Screen for the walking patient: one target and one picture."""
    with db.read() as c:
        session = sessions.get(c, sid)
        patient = patients.get(c, session.patient_id)
        view = view_patient_screen(c, session)
    record_opening(request, user, "session", sid)
    return render_page(
        request, db, user, "live-patient.html", "patients", session=session, patient=patient, **view
    )


def view_live(c: Connection, session: Session, patient: Patient, *, capture: str) -> dict[str, Any]:
    """Template context of the therapist's page; `capture` = URL of the tablet's page."""
    variables = [v for v in VARIABLES if v.name in JOINTS]
    return {
        "capture": capture,
        "only_here": urlsplit(capture).hostname in LOOPBACK,
        "protocol": PROTOCOL_NAMES.get(session.protocol, session.protocol),
        "joints": [(v.name, JOINTS[v.name]) for v in variables],
        "live": {
            "session": session.id,
            "patient": patient.id,
            "variables": [_variable(v) for v in variables],
            "segments": SEGMENT_NAMES,
            "terms": list_terms(),
            "choices": UNPRESCRIBED,
            "prescription": _prescribed(c, patient.id),
            "test": view_guided_test(session, patient),
        },
    }


def view_patient_screen(c: Connection, session: Session) -> dict[str, Any]:
    """Template context of the patient's screen."""
    return {
        "live": {
            "session": session.id,
            "patient": session.patient_id,
            "prescription": _prescribed(c, session.patient_id),
            "terms": list_terms(),
        }
    }


def _prescribed(c: Connection, patient_id: str) -> dict[str, Any] | None:
    """Prescription in force as JSON, None without one."""
    written = prescriptions.in_force(c, patient_id)
    return None if written is None else written.content.to_json()


def _variable(v: Variable) -> dict[str, Any]:
    return {
        "name": v.name,
        "label": f"{v.label}, {ZERO_WORDS['standing']}",
        "range": v.y_range,
        "ticks": v.ticks,
        "up": v.up,
        "down": v.down,
    }


def list_terms() -> dict[str, Any]:
    """Catalogue of parameters for the live pages."""
    return {
        e.name: {
            "label": e.label,
            "unit": e.printed_unit,
            "digits": e.digits,
            "comparison": e.comparison,
            "everyday": e.everyday,
            "is_length": e.is_length,
        }
        for e in CATALOGUE.values()
    }


def view_guided_test(session: Session, patient: Patient) -> dict[str, Any] | None:
    """Template context of a guided test before it begins; None for other sessions."""
    total = TOTAL.get(session.protocol)
    if total is None:
        return None
    age = patient.find_age(session.performed_on)
    return {
        "title": PROTOCOL_NAMES[session.protocol],
        "total": total,
        "label": CATALOGUE[total].label,
        "say": tell_person(session.protocol, "get_ready"),
        "hint": HINTS[session.protocol],
        "go": session.protocol.startswith("standing"),
        "rises": session.protocol == "five_sit_to_stand",
        "norm": norm_words(total, age, patient.sex),
        "meant": MEANT[total],
    }
