"""How long 24 visits of a patient take to read: from disk after a start, from memory after that."""

from __future__ import annotations

import datetime as dt
import statistics
import sys
import time
from pathlib import Path

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.report.history.trends import follow_figures, names_in
from sagittal.server.results import histories
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed

VISITS = 24
LIMIT_S = 0.3


@pytest.mark.anyio
async def test_trends_of_24_visits_are_read_within_300_ms(tmp_path: Path) -> None:
    results = analysed.files(60.0)
    async with open_clinic(tmp_path) as clinic:
        with clinic.db.write() as c:
            patient = patients.create(c, None, code="P-1", birth_year=1960, sex="male", height_m=1.75)
        for i in range(VISITS):
            with clinic.db.write() as c:
                day = dt.date(2026, 3, 2) + dt.timedelta(days=3 * i)
                session = sessions.create(c, None, patient.id, performed_on=day).id
            analysed.finish(clinic, patient.id, session, results)
        cold, warm, page = [], [], []
        for _ in range(5):
            clinic.app.state.reviewed.forget()
            cold.append(_read(clinic, patient))
            warm.append(_read(clinic, patient))
        async with clinic.client("viewer") as client:
            for _ in range(5):
                clinic.app.state.reviewed.forget()
                began = time.perf_counter()
                answer = await client.get(f"/patients/{patient.id}/trends")
                page.append(time.perf_counter() - began)
                assert answer.status_code == 200
    sys.stdout.write(f"cold {cold}, warm {warm}, page {page} s\n")
    assert statistics.median(cold) <= LIMIT_S
    assert statistics.median(page) <= LIMIT_S


def _read(clinic: Clinic, patient: patients.Patient) -> float:
    began = time.perf_counter()
    with clinic.db.read() as c:
        done, plans = histories.read(c, patient)
    known_history = histories.read_history(clinic.app.state.reviewed, patient, done, plans)
    figures = follow_figures(
        known_history.visits, names_in(known_history.visits), known_history.norms, known_history.usual
    )
    took = time.perf_counter() - began
    assert len(known_history.visits) == VISITS
    assert len(figures) > 20
    return took
