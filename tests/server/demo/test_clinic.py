from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from sagittal.core.pipeline import analyse
from sagittal.core.subject.condition import is_comparable
from sagittal.server.clinic import patients, sessions
from sagittal.server.demo.clinic import STROKE, VISITS, VOLUNTEER, fill, record
from sagittal.server.results import prescriptions
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.migrate import upgrade


@pytest.mark.sweep
def test_the_clinic_is_full_of_people_who_say_they_are_simulated(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path, min_free_bytes=0)
    upgrade(settings.database)
    fill(settings)
    with closing(Database(settings.database)) as db, db.read() as c:
        listed = patients.list_patients(c, None)
        visits = [v for p in listed for v in sessions.of_patient(c, p.id)]
        trained = [p.code for p in listed if prescriptions.in_force(c, p.id) is not None]
    assert sorted(v.title for v in visits) == sorted(v.title for v in VISITS)
    assert all(v.state == "running" for v in visits)
    assert all(p.note.startswith("Simulated.") for p in listed)
    assert any(p.sessions == 2 for p in listed)
    assert trained == ["NR-2107"], "somebody to walk live with feedback"


def test_the_two_walks_of_the_volunteer_are_not_compared_and_those_of_the_patient_are() -> None:
    walked = {p: [v.condition for v in VISITS if v.person is p] for p in (VOLUNTEER, STROKE)}
    assert not is_comparable(*walked[VOLUNTEER])
    assert is_comparable(*walked[STROKE])


@pytest.mark.sweep
@pytest.mark.parametrize(
    ("script", "method", "reduced"),
    [
        ("hemiparetic", "erkf_smoothed", None),
        ("antalgic", "l7s_3i", None),
        ("elderly", "l7s_2i", None),
        ("crouch", "l7s_3i", "sensor_failed"),
    ],
)
def test_every_estimator_has_its_visit(script: str, method: str, reduced: str | None) -> None:
    visit = next(v for v in VISITS if v.script == script)
    analysis = analyse(record(visit).recording)
    assert analysis.problem is None
    assert analysis.poses is not None
    assert (analysis.poses.method, analysis.poses.reduced) == (method, reduced)


@pytest.mark.sweep
def test_the_newest_walks_have_good_data_but_for_the_sensor_that_stopped() -> None:
    """Unusual gait is not mistaken for wrongly placed sensors."""
    newest = {v.person.code: v for v in reversed(VISITS)}
    warned = {
        code
        for code, visit in newest.items()
        if any(n.severity != "info" for n in analyse(record(visit).recording).notices)
    }
    assert warned == {"PD-0412"}
