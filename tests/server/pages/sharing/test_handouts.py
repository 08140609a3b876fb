"""Handouts accompanying the report."""

from __future__ import annotations

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.errors import Conflict
from sagittal.server.pages.sharing.handouts import gather_course, gather_leaflet
from tests.helpers.clinic import Clinic
from tests.server import analysed, crowd

pytestmark = pytest.mark.anyio


async def test_the_leaflet_is_of_a_walk_and_the_course_of_all(clinic: Clinic) -> None:
    ((first, last),) = crowd.fill(clinic, 1, 2, analysed.files())
    db, reviewed = clinic.db, clinic.app.state.reviewed
    with db.write() as c:
        patient = sessions.get(c, first).patient_id
        empty = sessions.create(c, None, patient).id
        nobody = patients.create(c, None, code="HA-2").id
    leaflet = gather_leaflet(db, reviewed, last)
    assert leaflet["figures"]
    assert leaflet["before"] == crowd.FIRST_DAY
    assert (leaflet["practise"], leaflet["practise_side"]) == (None, None)
    assert gather_leaflet(db, reviewed, first)["before"] is None
    course = gather_course(db, reviewed, patient)
    assert (course["titles"], len(course["conditions"])) == (["Walk", "Walk"], 2)
    identity = dict(course["identity"])
    assert (identity["Visits"], identity["Affected side"]) == ("2", "none or both")
    with pytest.raises(Conflict, match="no analysed walk"):
        gather_leaflet(db, reviewed, empty)
    with pytest.raises(Conflict, match="No visit"):
        gather_course(db, reviewed, nobody)
    async with clinic.client("viewer") as client:
        pages = [await client.get(p) for p in (f"/sessions/{last}/leaflet", f"/patients/{patient}/course")]
        refused = [await client.get(p) for p in (f"/sessions/{empty}/leaflet", f"/patients/{nobody}/course")]
    assert [a.status_code for a in pages] == [200, 200]
    assert f"/sessions/{last}/leaflet.pdf" in pages[0].text
    assert f"/patients/{patient}/course.pdf" in pages[1].text
    assert {a.status_code for a in refused} == {409}
    async with clinic.client("admin") as client:
        rows = (await client.get("/api/v1/audit")).json()
    opened = {r["action"]: r["resource_id"] for r in rows if r["user_name"] == "viewer"}
    assert (opened["leaflet.opened"], opened["course.opened"]) == (last, patient)
    async with clinic.client("assistant") as client:
        assert (await client.get(f"/patients/{patient}/course")).status_code == 403
