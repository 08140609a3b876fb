"""Who opened or changed what, a hundred rows to a page."""

from __future__ import annotations

import re

import pytest

from sagittal.server import audit
from sagittal.server.pages.audit_log import AUDIT_ROWS
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


async def test_older_rows_are_a_page_further_until_there_are_none(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        for k in range(AUDIT_ROWS + 5):
            audit.record(c, None, "patient.created", "patient", f"{k:032x}")
    observations, path, pages = list[str](), "/audit", 0
    async with clinic.client("admin") as client:
        while path:
            page = (await client.get(path)).text
            observations += re.findall(r"before=(\d+)", page)
            further = re.search(r'href="(/audit\?before=\d+)"', page)
            path, pages = further[1] if further else "", pages + 1
        assert pages == 2
        assert (await client.get("/audit?before=0")).status_code == 422
    with clinic.db.read() as c:
        rows = audit.list_entries(c, before_seq=None, limit=1000)
    assert observations == [str(rows[AUDIT_ROWS - 1].seq)]
    async with clinic.client("clinician") as client:
        assert (await client.get("/audit")).status_code == 403
