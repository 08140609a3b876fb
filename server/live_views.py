"""What the live pages start with, as plain values: scales and norms of curves, terms, prescription."""

from __future__ import annotations

from typing import Any, Final
from urllib.parse import urlsplit

from sqlalchemy import Connection

from core.norms import norms_for
from core.norms.speed import SLOW_MPS
from server.page_views import PROTOCOL_NAMES, SEGMENT_NAMES
from server.report.notes import GROUPS
from server.report.wording import NO_NORM, TERMS, VARIABLES, ZERO_WORDS, Variable
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

GAIT_SPEED: Final = "gait_speed_mps"


def live_view(c: Connection, session: Session, patient: Patient, *, capture: str) -> dict[str, Any]:
    """The therapist's page; `capture` = address of the page the tablet opens."""
    age = session.performed_on.year - patient.birth_year if patient.birth_year else None
    height = session.height_m if session.height_m is not None else patient.height_m
    # how fast the person will walk is not known yet: everybody's comfortable pace, until they prove slower
    norms = norms_for(age, patient.sex, None, height)  # type: ignore[arg-type]
    bands = {name: band for name, band in norms.bands.items() if band.comparable}
    given = _prescribed(c, patient.id)
    shown = [v for v in VARIABLES if v.name in JOINTS]
    source = next((bands[v.name] for v in shown if v.name in bands), None)
    note = NO_NORM.get(norms.reason or "", "No norm for this person.")
    if source is not None:
        who = GROUPS.get(source.group, source.group)
        note = f"Norm: {source.n} {who}, mean ± 1 SD. Angles {ZERO_WORDS['standing']}; compare shapes."
    return {
        "capture": capture,
        "only_here": urlsplit(capture).hostname in LOOPBACK,
        "protocol": PROTOCOL_NAMES.get(session.protocol, session.protocol),
        "joints": [(v.name, JOINTS[v.name]) for v in shown],
        "norm_note": note,
        "live": {
            "session": session.id,
            "patient": patient.id,
            "variables": [_variable(v, bands.get(v.name)) for v in shown],
            "norm_note": note,
            "slow": {
                "below_mps": SLOW_MPS,
                "parameter": GAIT_SPEED,
                "words": NO_NORM["no_speed_matched_norm"],
            },
            "segments": SEGMENT_NAMES,
            "terms": _terms(),
            "choices": [name for name in UNPRESCRIBED if name in TERMS],
            "prescription": given,
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


def _variable(v: Variable, band: Any) -> dict[str, Any]:
    norm = None
    if band is not None:
        norm = {"mean": band.mean_deg.round(2).tolist(), "sd": band.sd_deg.round(2).tolist()}
    return {
        "name": v.name,
        "label": v.label,
        "range": v.y_range,
        "ticks": v.ticks,
        "up": v.up,
        "down": v.down,
        "norm": norm,
    }


def _terms() -> dict[str, Any]:
    return {
        name: {"label": t.label, "unit": t.unit, "digits": t.digits, "comparison": t.comparison}
        for name, t in TERMS.items()
    }
