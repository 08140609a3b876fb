"""What the live page knows of a guided functional test before it begins."""

from __future__ import annotations

from typing import Any

from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.pages.words import PROTOCOL_NAMES
from sagittal.server.report.view.functional import MEANT, norm_words
from sagittal.server.report.words.guided_words import HINTS, TOTAL, tell_person


def view_guided_test(session: Session, patient: Patient) -> dict[str, Any] | None:
    """Words and norm of the session's test; None of other sessions."""
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
