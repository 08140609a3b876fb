"""Guided test on the live page before its start."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from typing import Any

import pytest

from sagittal.core.frames import PROTOCOLS
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.pages.live_takes.live import view_guided_test
from sagittal.server.report.view.functional import norm_words
from sagittal.server.report.words.guided_words import HINTS, TOTAL
from sagittal.server.storage.schema.tables import now

PATIENT = Patient("1", "P-1", "female", 1950, 1.7, None, False, "", now(), 1, None, False)
SESSION = Session(
    "2",
    "1",
    "P-1",
    "Test",
    dt.date(2026, 3, 1),
    "walk",
    None,
    None,
    None,
    None,
    None,
    False,
    "",
    now(),
    False,
    "empty",
)


def view(protocol: Any, patient: Patient = PATIENT) -> dict[str, Any] | None:
    return view_guided_test(replace(SESSION, protocol=protocol), patient)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_every_guided_test_has_words_and_no_other_session(protocol: Any) -> None:
    visible_view = view(protocol)
    if protocol not in TOTAL:
        assert visible_view is None
        return
    assert visible_view is not None
    assert (visible_view["total"], visible_view["label"]) == (
        TOTAL[protocol],
        CATALOGUE[TOTAL[protocol]].label,
    )
    assert visible_view["hint"] == HINTS[protocol]
    assert all(visible_view[key] for key in ("title", "say", "meant"))
    assert visible_view["go"] == protocol.startswith("standing")
    assert visible_view["rises"] == (protocol == "five_sit_to_stand")
    assert visible_view["norm"] == norm_words(TOTAL[protocol], 76, "female")


def test_the_norm_is_of_the_age_at_the_visit() -> None:
    (old, young) = (view("tug", replace(PATIENT, birth_year=year)) for year in (1942, 1965))
    assert old is not None
    assert young is not None
    assert old["norm"] == norm_words(TOTAL["tug"], 84, "female")
    assert old["norm"] != young["norm"]
