"""Consents of a patient over the API."""

from __future__ import annotations

import pytest

from sagittal.server.clinic import patients
from sagittal.server.storage.schema.tables import now
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio
API = "/api/v1"


async def test_consent_is_given_listed_and_withdrawn_once_by_who_may(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="C-1").id
    address = f"{API}/patients/{patient}/consents"
    body = {"purpose": "research", "evidence": "form 12", "given_on": "2026-01-31"}
    async with clinic.client("clinician") as client:
        first = await client.post(address, json=body)
        assert first.status_code == 201, first.text
        assert {k: first.json()[k] for k in body} == body
        second_response = await client.post(address, json=body)
        assert second_response.status_code == 409
        withdraw = f"{API}/consents/{first.json()['id']}/withdraw"
        gone = await client.post(withdraw)
        assert gone.json()["withdrawn_on"] == now().date().isoformat()
        assert (await client.post(withdraw)).status_code == 409
        anew = await client.post(address, json=body | {"evidence": "form 13"})
        assert (await client.get(address)).json() == [anew.json(), gone.json()]
        for wrong in ({"purpose": "fun"}, {"evidence": " "}, {"given_on": "31.1.2026"}):
            assert (await client.post(address, json=body | wrong)).status_code == 422, wrong
        assert (await client.get(f"{API}/patients/{'0' * 32}/consents")).status_code == 404
        assert (await client.post(f"{API}/consents/{'0' * 32}/withdraw")).status_code == 404
    async with clinic.client("viewer") as client:
        assert len((await client.get(address)).json()) == 2
        assert (await client.post(address, json=body)).status_code == 403
    async with clinic.client("admin") as client:
        rows = (await client.get(f"{API}/audit")).json()
    assert [r["user_name"] for r in rows if r["action"] == "consents.opened"] == ["viewer", "clinician"]
