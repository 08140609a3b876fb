"""Two visits side by side."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from sagittal.server.pages.results.compare import _pairs, view_comparison
from sagittal.server.results import comparisons
from tests.helpers.clinic import Clinic
from tests.server import analysed, crowd

pytestmark = pytest.mark.anyio


def test_a_title_that_rows_share_stands_once() -> None:
    rows: list[Any] = [SimpleNamespace(change=SimpleNamespace(name=name)) for name in ("a", "b", "b", "c")]
    assert [n for _, n in _pairs(rows)] == [1, 2, 0, 1]
    assert [r for r, _ in _pairs(rows)] == rows


async def test_the_earlier_visit_stands_first_and_the_same_walk_has_not_changed(clinic: Clinic) -> None:
    ((first, last),) = crowd.fill(clinic, 1, 2, analysed.files())
    with clinic.db.read() as c:
        pair = comparisons.pair(c, last, first)
    assert (pair.before.session.id, pair.after.session.id) == (first, last)
    view = view_comparison(clinic.app.state.reviewed, pair)
    assert view["used"]["before"] == view["used"]["after"]
    assert view["real"] == []
    assert len(view["charts"]) >= 4
    visible_rows = [row for _, rows in (*view["groups"], *view["more"]) for row, _ in rows]
    assert {row.change.difference for row in visible_rows if row.change.difference is not None} == {0.0}
    assert view["figure"] is True
    patient = pair.patient.id
    compare = f"/patients/{patient}/compare"
    async with clinic.client("viewer") as client:
        for ticked, led in (
            ([first, last], f"/sessions/{first}/compare/{last}"),
            ([first], f"/patients/{patient}"),
            ([first, first], f"/patients/{patient}"),
            ([first, last, "0" * 32], f"/patients/{patient}"),
            ([], f"/patients/{patient}"),
        ):
            answer = await client.get(compare, params={"visit": ticked})
            assert (answer.status_code, answer.headers["location"]) == (303, led)
        assert (await client.get(compare, params={"visit": "x"})).status_code == 422
        assert (await client.get(f"/sessions/{last}/compare/{first}")).status_code == 200
    async with clinic.client("admin") as client:
        rows = (await client.get("/api/v1/audit")).json()
    assert {first, last} <= {r["resource_id"] for r in rows if r["action"] == "session.opened"}
