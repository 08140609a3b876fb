"""PostgreSQL is restarted while the web server and a worker have something under way."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from sagittal.server.processes.supervisor import Workers
from tests.faults.clinic import Clinic, until
from tests.helpers.clinic import open_clinic
from tests.helpers.postgres import stopped_server

pytestmark = pytest.mark.postgres


@pytest.mark.anyio
async def test_a_restart_of_postgresql_costs_a_sentence_and_no_work(
    tmp_path: Path, postgres: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONWARNINGS", "error")
    clinic = Clinic(tmp_path, lease_s=1.5, database_url=postgres)
    workers = Workers(replace(clinic.settings, workers=1))
    workers.start()
    try:
        async with open_clinic(tmp_path, database_url=postgres) as web, web.client("admin") as client:
            with closing(clinic.db):
                held, reached, gate = clinic.hold("second")
                waiting = clinic.submit()
                until(reached.exists)
                path = f"/api/v1/patients/{clinic.patient.id}"
                initial_body = (await client.get(path)).raise_for_status().json()
                with stopped_server():
                    offset = [
                        await client.get(path),
                        await client.post("/api/v1/patients", json={"code": "P-2"}),
                    ]
                gate.touch()
                assert [answer.status_code for answer in offset] == [503, 503]
                assert {answer.json()["code"] for answer in offset} == {"database_busy"}
                assert (await client.get(path)).raise_for_status().json()["id"] == initial_body["id"]
                added = await client.post("/api/v1/patients", json={"code": "P-2"})
                assert added.status_code == 201
                ended = [clinic.ended(view) for view in (held, waiting)]
                assert [view.state for view in ended] == ["done", "done"]
                assert len(clinic.results()) == len(ended)
    finally:
        workers.stop()
