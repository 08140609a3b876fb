from __future__ import annotations

import pytest

from sagittal.core.estimators import BY_NAME, ESTIMATORS
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio

PATH = "/api/v1/estimators"


async def test_every_estimator_is_listed_with_its_sensors_and_its_paper(clinic: Clinic) -> None:
    async with clinic.client("assistant") as client:
        answer = await client.get(PATH)
    assert answer.status_code == 200
    notices = {e["name"]: e for e in answer.json()}
    assert list(notices) == [e.name for e in ESTIMATORS]
    for name, view in notices.items():
        reference = BY_NAME[name]
        assert {frozenset(needed) for needed in view["sensor_sets"]} == set(reference.sets)
        assert view["title"] == reference.choice
        assert view["paper"] == (
            reference.paper and {"citation": reference.paper.citation, "doi": reference.paper.doi}
        )
    assert any(e["paper"] for e in notices.values())


async def test_a_stranger_is_not_told(clinic: Clinic) -> None:
    async with clinic.client() as client:
        assert (await client.get(PATH)).status_code == 401
