"""Consents: immutable, one valid per purpose, deleted with the patient."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from sagittal.server.clinic import consents
from sagittal.server.errors import Conflict, ServiceError
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import erasure
from sagittal.server.storage.schema.tables import now
from tests.faults.clinic import Clinic


def test_consent_is_given_withdrawn_given_anew_and_erased_with_the_patient(tmp_path: Path) -> None:
    clinic = Clinic(tmp_path, lease_s=5.0)
    pid = clinic.patient.id
    long_ago = dt.date(2024, 2, 29)
    with clinic.db.write() as c:
        first = consents.give(c, None, pid, purpose="research", evidence=" form 12 ", given_on=long_ago)
        assert (first.given_on, first.evidence, first.withdrawn_on) == (long_ago, "form 12", None)
        with pytest.raises(Conflict, match="in force"):
            consents.give(c, None, pid, purpose="research", evidence="form 13")
        consents.give(c, None, pid, purpose="teaching", evidence="by e-mail")
        assert consents.withdraw(c, None, first.id).withdrawn_on == now().date()
        with pytest.raises(Conflict):
            consents.withdraw(c, None, first.id)
        second = consents.give(c, None, pid, purpose="research", evidence="form 14")
        retained = consents.of_patient(c, pid)
        assert {one.id for one in retained[:2]} >= {second.id}
        assert (retained[-1].id, len(retained)) == (first.id, 3)
        for wrong in (
            {"purpose": "fun"},
            {"evidence": " "},
            {"given_on": now().date() + dt.timedelta(days=1)},
        ):
            with pytest.raises(ServiceError):
                consents.give(c, None, pid, **{"purpose": "sharing", "evidence": "x", **wrong})  # type: ignore[arg-type]
    erasure.erase_patient(
        clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, None, pid, confirm="P-1"
    )
    with clinic.db.read() as c:
        assert consents.of_patient(c, pid) == []
    clinic.db.close()
