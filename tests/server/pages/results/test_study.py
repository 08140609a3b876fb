"""Which visits go into the tables of a study."""

from __future__ import annotations

import datetime as dt

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.pages.results import study
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def test_what_is_chosen_stands_in_the_page_and_in_the_address_of_the_tables(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="ST-1").id
        ids = [
            sessions.create(c, None, patient, title=title, performed_on=dt.date(2026, month, 1)).id
            for title, month in (("Winter", 1), ("Spring", 4))
        ]
    for session in ids:
        analysed.finish(clinic, patient, session, analysed.files())
    async with clinic.client("clinician") as client:
        whole = (await client.get("/study")).text
        since = (await client.get("/study?since=2026-03-01&q=ST&protocol=walk")).text
        nothing = (await client.get("/study?until=2025-01-01")).text
        assert (await client.get("/study?since=tomorrow")).status_code == 422
    assert [t in whole for t in ("Winter", "Spring")] == [True, True]
    assert [t in since for t in ("Winter", "Spring")] == [False, True]
    assert [t in nothing for t in ("Winter", "Spring")] == [False, False]
    assert [sid in since for sid in ids] == [False, True]
    assert ("download>" in since, 'name="ticked" value="true"' in since) == (False, True)
    # of more visits than can be ticked the choice is in the address
    monkeypatch.setattr(study, "TICKED_AT_MOST", 0)
    async with clinic.client("clinician") as client:
        many = (await client.get("/study?since=2026-03-01&q=ST&protocol=walk")).text
    assert "/api/v1/study.zip?q=ST&amp;protocol=walk&amp;since=2026-03-01&amp;until=" in many
    async with clinic.client("assistant") as client:
        assert (await client.get("/study")).status_code == 403
