"""Dated notes about a patient: order and permission to delete."""

from __future__ import annotations

import datetime as dt

import pytest

from sagittal.server.auth import accounts
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.clinic import notes, patients
from sagittal.server.storage.schema.tables import now
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio

API = "/api/v1"


async def test_a_note_is_removed_by_who_wrote_it_or_an_administrator(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        other_id = accounts.create(c, "colleague", None, Role.CLINICIAN, "x").id
        patient = patients.create(c, None, code="V-NOTES").id
        colleague = Identity(other_id, "colleague", "", Role.CLINICIAN, "")
        theirs = notes.add(c, colleague, patient, "Written by a colleague.").id
    async with clinic.client("clinician") as client:
        mine = (await client.post(f"{API}/patients/{patient}/notes", json={"content": "My own."})).json()[
            "id"
        ]
        html = (await client.get(f"/patients/{patient}")).text
        assert f'commandfor="remove-note-{mine}"' in html
        assert "Remove this note?" in html
        assert theirs not in html
        refused = await client.delete(f"{API}/notes/{theirs}")
        assert (refused.status_code, refused.json()["code"]) == (403, "not_yours")
        assert "colleague wrote this note" in refused.json()["detail"]
        assert (await client.delete(f"{API}/notes/{mine}")).status_code == 204
    async with clinic.client("admin") as client:
        assert theirs in (await client.get(f"/patients/{patient}")).text
        assert (await client.delete(f"{API}/notes/{theirs}")).status_code == 204


async def test_notes_are_listed_by_day_with_their_author_and_each_look_is_a_row(
    clinic: Clinic,
) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="N-LIST").id
    address = f"{API}/patients/{patient}/notes"
    async with clinic.client("clinician") as client:
        today = now().date()
        earlier = await client.post(address, json={"content": "Later typed.", "written_on": "2026-02-20"})
        newest = await client.post(address, json={"content": "Of today."})
        assert (earlier.status_code, newest.status_code) == (201, 201)
        assert dt.date.fromisoformat(newest.json()["written_on"]) - today <= dt.timedelta(days=1)
        listed = (await client.get(address)).json()
        assert listed == [newest.json(), earlier.json()]
        assert {n["by"] for n in listed} == {"clinician"}
        for wrong in ({"content": " \n"}, {"content": "x", "day": "2026-02-20"}, {}):
            assert (await client.post(address, json=wrong)).status_code == 422, wrong
        nobody = f"{API}/patients/{'0' * 32}/notes"
        assert [
            (await client.get(nobody)).status_code,
            (await client.post(nobody, json={"content": "x"})).status_code,
        ] == [404, 404]
        assert (await client.delete(f"{API}/notes/{'0' * 32}")).status_code == 404
    async with clinic.client("viewer") as client:
        assert (await client.get(address)).json() == listed
        assert (await client.post(address, json={"content": "x"})).status_code == 403
    async with clinic.client("admin") as client:
        rows = (await client.get(f"{API}/audit")).json()
    looked = [r["user_name"] for r in rows if (r["action"], r["resource_id"]) == ("notes.opened", patient)]
    assert looked == ["viewer", "clinician"]
