"""The audit trail over the API: in pages, the newest first, and its head."""

from __future__ import annotations

import pytest

from sagittal.server import audit
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio
API = "/api/v1/audit"


async def test_rows_come_newest_first_in_pieces_and_the_head_is_the_newest(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        for k in range(5):
            audit.record(c, None, "test.done", "thing", f"{k}", {"k": k})
    async with clinic.client("admin") as client:
        rows = (await client.get(API)).json()
        assert [r["detail"]["k"] for r in rows[:5]] == [4, 3, 2, 1, 0]
        assert [r["seq"] for r in rows] == sorted((r["seq"] for r in rows), reverse=True)
        assert set(rows[0]) == {
            "seq", "at", "user_id", "user_name", "action", "resource", "resource_id", "detail", "hash",
        }  # fmt: skip
        two = (await client.get(API, params={"limit": 2, "before": rows[1]["seq"]})).json()
        assert two == rows[2:4]
        head = (await client.get(f"{API}/head")).json()
        assert head == {"seq": rows[0]["seq"], "hash": rows[0]["hash"]}
        for wrong in ({"limit": 0}, {"limit": 1001}, {"before": 0}, {"before": 2**53 + 1}):
            assert (await client.get(API, params=wrong)).status_code == 422, wrong
    async with clinic.client("clinician") as client:
        assert [(await client.get(path)).status_code for path in (API, f"{API}/head")] == [403, 403]
