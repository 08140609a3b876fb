"""Cost of first views: a session page with many controls, and a large undescribed table."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any, Final

import pytest

from sagittal.server.clinic import patients, sessions
from tests.helpers.clinic import open_clinic
from tests.server import analysed, crowd
from tests.server.api.uploads.test_files import API, new_session
from tests.server.api.uploads.test_tables import table
from tests.server.pages.test_statements import MOST
from validation.figures import record_goal

pytestmark = pytest.mark.anyio

CONTROLS: Final = 200
FIRST_S: Final = 0.3
TABLE_MB: Final = 100.0
PREVIEW_S: Final = 0.5
BUSY: Final = 6.0
"""The aims are those of a quiet machine of today; elsewhere only gross losses fail."""


async def test_a_page_beside_two_hundred_controls_asks_no_more_and_reads_them_once(tmp_path: Path) -> None:
    async with open_clinic(tmp_path / "clinic") as clinic:
        files = analysed.files()
        crowd.fill(clinic, CONTROLS, 1, files, controls=True)
        with clinic.db.write() as c:
            patient = patients.create(c, None, code="P-1", sex="male", birth_year=1960, height_m=1.75).id
            session = sessions.create(c, None, patient).id
        analysed.finish(clinic, patient, session, files)
        took = []
        async with clinic.client("admin") as client:
            (await client.get("/account")).raise_for_status()
            for _ in range(4):
                began = time.process_time()
                (await client.get(f"/sessions/{session}")).raise_for_status()
                took.append(time.process_time() - began)
            with crowd.statements() as sent:
                (await client.get(f"/sessions/{session}")).raise_for_status()
    first, later = took[0], min(took[1:])
    sys.stdout.write(f"first {first:.3f} s, later {later:.4f} s of CPU, {len(sent)} statements\n")
    record_goal(f"first session page beside {CONTROLS} visits of controls, CPU", FIRST_S, first, "s")
    record_goal(f"statements of a session page beside {CONTROLS} visits of controls", MOST, len(sent), "")
    assert len(sent) <= MOST
    assert first <= BUSY * FIRST_S
    assert later <= first


async def test_a_large_table_is_looked_at_without_reading_all_of_it(tmp_path: Path) -> None:
    head, _, rows = table().partition(b"\n")
    large = head + b"\n" + (rows + b"\n") * round(1e6 * TABLE_MB / (len(rows) + 1))
    async with open_clinic(tmp_path / "clinic") as clinic:
        session = await new_session(clinic, "TABLE-1")
        position = f"{API}/sessions/{session}"
        async with clinic.client("clinician", timeout=120) as client:
            (await client.put(f"{position}/files/large_lf.csv", content=large)).raise_for_status()
            began = time.process_time()
            (shape,) = (await client.get(f"{position}/tables")).raise_for_status().json()
            body: dict[str, Any] = {"file": "large_lf.csv", "source": shape["source"] | {"rate_hz": 100}}
            (check,) = (await client.post(f"{position}/tables/checks", json=body)).raise_for_status().json()
            took = time.process_time() - began
    sys.stdout.write(f"a table of {len(large) / 1e6:.0f} MB: guessed and checked in {took:.3f} s of CPU\n")
    record_goal(f"preview of a table of {TABLE_MB:g} MB, CPU", PREVIEW_S, took, "s")
    assert check["problems"] == []
    assert took <= BUSY * PREVIEW_S
