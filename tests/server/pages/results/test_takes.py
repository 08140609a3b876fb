"""Trials of one visit compared."""

from __future__ import annotations

import datetime as dt

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.pages.results.report_rows import select_first
from sagittal.server.pages.results.takes import view_takes
from sagittal.server.report.words.change_words import find_term
from sagittal.server.results import histories, reports
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def test_takes_of_a_day_stand_beside_each_other_with_their_mean(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        pid = patients.create(c, None, code="TK-1").id
        one, second, single = (
            sessions.create(c, None, pid, title=title, performed_on=dt.date(2026, 3, day)).id
            for title, day in (("One", 2), ("Other", 2), ("Alone", 9))
        )
    for sid in (one, second, single):
        analysed.finish(clinic, pid, sid, analysed.files())
    with clinic.db.read() as c:
        patient = patients.get(c, pid)
        done = histories.list_analysed(c, pid)
    reviewed = clinic.app.state.reviewed
    this = next(a for a in done if a.session.id == second)
    first = select_first(reports.read(reviewed, this.found, this.edits, patient, this.session)[1])
    assert view_takes(reviewed, done, single, first) is None
    assert view_takes(reviewed, done, second, ()) == {
        "columns": [
            {"id": one, "title": "One", "this": False},
            {"id": second, "title": "Other", "this": True},
        ],
        "rows": [],
    }
    view = view_takes(reviewed, done, second, first)
    assert view is not None
    speed = next(r for r in view["rows"] if r["title"] == find_term("gait_speed_mps").label)
    assert (speed["unit"], speed["side"]) == ("m/s", None)
    assert speed["cells"][0] == speed["cells"][1]
    assert speed["cells"][0].startswith(f"{speed['mean']} ± ")
    stance = [r for r in view["rows"] if r["title"] == find_term("stance_pct").label]
    assert [r["side"] for r in stance] == ["left", "right"]
