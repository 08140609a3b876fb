"""Sensitivity page of squat angles."""

from __future__ import annotations

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.pages.results.sensitivity import list_choices
from sagittal.server.uploads import reference_files
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def test_only_tables_can_be_held_against_and_the_analysis_is_named(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="SN-1").id
        session = sessions.create(c, None, patient, protocol="squat").id
    path = f"/sessions/{session}/sensitivity"
    async with clinic.client("assistant") as client:
        for name in ("optical.sto", "Angles.PARQUET"):
            put = await client.put(f"/api/v1/sessions/{session}/references/{name}", content=b"t\n")
            assert put.is_success, put.text
        assert (await client.get(path)).status_code == 403
    with clinic.db.read() as c:
        initial_choices = list_choices(c, session)
        assert len(reference_files.list_files(c, session)) == 2
    assert (initial_choices["analysed"], initial_choices["work"], initial_choices["view"]) == (
        None,
        None,
        None,
    )
    done = analysed.finish(clinic, patient, session, analysed.files())
    with clinic.db.read() as c:
        final_choices = list_choices(c, session)
    assert final_choices["analysed"] == done
    assert final_choices["references"] == initial_choices["references"] == ["Angles.PARQUET"]
    async with clinic.client("clinician") as client:
        page = await client.get(f"{path}?run=nothing&show=step")
    assert page.status_code == 200
    assert [name in page.text for name in ("Angles.PARQUET", "optical.sto")] == [True, False]
