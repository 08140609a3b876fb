"""Programmes over the API: begun, moved, linked with what took place, ended."""

from __future__ import annotations

import datetime as dt

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.storage.schema.tables import now
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio
API = "/api/v1"


async def test_a_programme_is_begun_moved_linked_and_ended(clinic: Clinic) -> None:
    today = now().date()
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="PR-1").id
        walk = sessions.create(c, None, patient, performed_on=today).id
        strange = sessions.create(c, None, patients.create(c, None, code="PR-2").id).id
    address = f"{API}/patients/{patient}/programmes"
    async with clinic.client("clinician") as client:
        response = await client.post(address, json={"starts_on": today.isoformat()})
        assert response.status_code == 201, response.text
        assert (await client.post(address, json={"starts_on": today.isoformat()})).status_code == 409
        assert (
            await client.post(address, json={"starts_on": today.isoformat(), "template": "x"})
        ).status_code == 422
        assert (await client.get(address)).json() == [response.json()]
        visit = next(v for v in response.json()["visits"] if v["kind"] == "training")
        position = f"{API}/planned-visits/{visit['id']}"

        def found(answer: dict[str, object]) -> dict[str, object]:
            return next(v for v in answer["visits"] if v["id"] == visit["id"])  # type: ignore[attr-defined]

        moved = (today + dt.timedelta(days=1)).isoformat()
        final_response = await client.patch(position, json={"planned_on": moved})
        assert (found(final_response.json())["planned_on"], found(final_response.json())["session_id"]) == (
            moved,
            None,
        )
        linked = await client.patch(position, json={"session_id": walk})
        assert (found(linked.json())["session_id"], found(linked.json())["state"]) == (walk, "done")
        assert found(linked.json())["planned_on"] == moved, "what is left out stays"
        assert (await client.patch(position, json={"session_id": strange})).status_code == 409
        freed = await client.patch(position, json={"session_id": None})
        assert found(freed.json())["session_id"] is None
        one = f"{API}/programmes/{response.json()['id']}"
        assert (await client.delete(one)).status_code == 204
        assert (await client.delete(one)).status_code == 404
        assert (await client.get(address)).json() == []
        assert (await client.get(f"{API}/sessions/{walk}")).status_code == 200
    async with clinic.client("viewer") as client:
        assert (await client.post(address, json={"starts_on": today.isoformat()})).status_code == 403
