"""What the live pages start with, as plain values: scales of curves, terms, prescription."""

from __future__ import annotations

from typing import Any, Final
from urllib.parse import urlsplit

from sqlalchemy import Connection

from server.page_views import PROTOCOL_NAMES, SEGMENT_NAMES
from server.report.wording import TERMS, VARIABLES, ZERO_WORDS, Variable
from server.services import prescriptions
from server.services.patients import Patient
from server.services.sessions import Session

JOINTS: Final = {"hip_flexion": "Hip", "knee_flexion": "Knee", "ankle_dorsiflexion": "Ankle"}
"""Variables of the current stride → the word on the button; the sagittal plane, which live is sure of."""

UNPRESCRIBED: Final = (
    "step_length_m",
    "stride_length_m",
    "stride_time_s",
    "stance_pct",
    "knee_flexion_max_swing_deg",
    "foot_pitch_ic_deg",
)
"""What the strip of strides offers to watch when nothing is prescribed."""

LOOPBACK: Final = ("127.0.0.1", "::1", "localhost")


def live_view(c: Connection, session: Session, patient: Patient, *, capture: str) -> dict[str, Any]:
    """The therapist's page; `capture` = address of the page the tablet opens."""
    shown = [v for v in VARIABLES if v.name in JOINTS]
    return {
        "capture": capture,
        "only_here": urlsplit(capture).hostname in LOOPBACK,
        "protocol": PROTOCOL_NAMES.get(session.protocol, session.protocol),
        "joints": [(v.name, JOINTS[v.name]) for v in shown],
        "live": {
            "session": session.id,
            "patient": patient.id,
            "variables": [_variable(v) for v in shown],
            "segments": SEGMENT_NAMES,
            "terms": _terms(),
            "choices": [name for name in UNPRESCRIBED if name in TERMS],
            "prescription": _prescribed(c, patient.id),
        },
    }


def patient_view(c: Connection, session: Session) -> dict[str, Any]:
    """The patient's screen."""
    return {
        "live": {
            "session": session.id,
            "patient": session.patient_id,
            "prescription": _prescribed(c, session.patient_id),
            "terms": _terms(),
        }
    }


def _prescribed(c: Connection, patient_id: str) -> dict[str, Any] | None:
    """What the prescription in force says, None without one."""
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


def _terms() -> dict[str, Any]:
    return {
        name: {"label": t.label, "unit": t.unit, "digits": t.digits, "comparison": t.comparison}
        for name, t in TERMS.items()
    }
