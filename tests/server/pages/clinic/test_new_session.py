"""The form of a new visit."""

from __future__ import annotations

import re

import pytest

from sagittal.core.frames import PROTOCOLS
from sagittal.core.subject.condition import USUAL
from sagittal.server.clinic import patients, programmes
from sagittal.server.storage.schema.tables import now
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


async def test_the_form_offers_today_every_protocol_and_the_planned_visit_next_to_it(clinic: Clinic) -> None:
    today = now().date()
    with clinic.db.write() as c:
        patient, planned = (patients.create(c, None, code=code).id for code in ("NS-1", "NS-2"))
        plan = programmes.start(c, None, planned, starts_on=today)
    near = plan.near(today)
    assert near is not None
    async with clinic.client("assistant") as client:
        form = (await client.get(f"/patients/{patient}/sessions/new")).text
        offered = (await client.get(f"/patients/{planned}/sessions/new")).text
        assert (await client.get(f"/patients/{'0' * 32}/sessions/new")).status_code == 404
    assert f'value="{today.isoformat()}"' in form
    values = set(re.findall(r'value="(\w+)"', form))
    assert set(PROTOCOLS) <= values
    assert {USUAL.pace, USUAL.aid, USUAL.shoes} <= values
    assert "planned_visit_id" not in form
    assert all(f'value="{v.id}"' in offered for v in plan.visits)
    assert re.search(rf'value="{near.id}"\s+(selected|checked)', offered)
    async with clinic.client("viewer") as client:
        assert (await client.get(f"/patients/{patient}/sessions/new")).status_code == 403
