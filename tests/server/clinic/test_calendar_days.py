"""A mistyped year of a plan or a note is refused."""

from __future__ import annotations

import datetime as dt

import pytest

from sagittal.server.clinic import notes, patients, programmes
from sagittal.server.errors import ServiceError
from sagittal.server.storage.db import Database


@pytest.mark.parametrize("day", [dt.date(1, 1, 1), dt.date(9998, 12, 1)])
def test_a_day_that_nobody_means_is_refused(db: Database, day: dt.date) -> None:
    with db.write() as c:
        patient = patients.create(c, None, code="DAY-1").id
        plan = programmes.start(c, None, patient, starts_on=dt.date(2026, 3, 2))
    for act in (
        lambda c: programmes.start(c, None, patient, starts_on=day),
        lambda c: programmes.change_visit(c, None, plan.visits[0].id, {"planned_on": day}),
        lambda c: notes.add(c, None, patient, "Seen.", day),
    ):
        with db.write() as c, pytest.raises(ServiceError, match="check the year"):
            act(c)
