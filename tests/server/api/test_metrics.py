"""Prometheus metrics, their permissions, and the dashboard."""

from __future__ import annotations

import datetime as dt
import json
import re

import pytest
from prometheus_client.parser import text_string_to_metric_families

from sagittal.server.safekeeping import backup_schedule
from sagittal.server.safekeeping.backup_schedule import BackupState, Outcome
from tests.data import ROOT
from tests.helpers.clinic import PASSWORD, Clinic

pytestmark = pytest.mark.anyio
CANARY = "Kanari-Vogel"


@pytest.mark.slow
async def test_figures_of_requests_jobs_parts_disk_and_backups(clinic: Clinic) -> None:
    timestamp = dt.datetime(2026, 3, 14, tzinfo=dt.UTC)
    good = Outcome(timestamp, True, "x.tar", "", 5000)
    backup_schedule._write(clinic.settings, BackupState(good, good, good))
    async with clinic.client("admin") as admin:
        response = await admin.post("/api/v1/patients", json={"code": CANARY})
        await admin.get(f"/api/v1/patients?search={CANARY}")
        await admin.get(f"/api/v1/patients/{response.json()['id']}")
        await admin.get(f"/nowhere/{CANARY}")
        for method in ("MADEUP", "INVENTED"):
            await admin.request(method, "/metrics")
        text = (await admin.get("/metrics")).text
        body = {"name": "Prometheus", "scopes": ["metrics"], "days": 365, "password": PASSWORD}
        token = (await admin.post("/api/v1/account/tokens", json=body)).json()["token"]
    async with clinic.client(headers={"authorization": f"Bearer {token}"}) as scraper:
        assert (await scraper.get("/metrics")).status_code == 200
        assert (await scraper.get("/api/v1/patients")).status_code == 403
    async with clinic.client() as nobody, clinic.client("clinician") as clinician:
        assert (await nobody.get("/metrics")).status_code == 401
        assert (await clinician.get("/metrics")).status_code == 403
    result = {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    one = ("method", "GET"), ("route", "/api/v1/patients/{patient_id}"), ("status", "200")
    assert result["sagittal_requests_total", *one] == 1
    assert result["sagittal_requests_total", ("method", "GET"), ("route", "none"), ("status", "404")] == 1
    second = ("method", "other"), ("route", "/metrics"), ("status", "405")
    assert result["sagittal_requests_total", *second] == 2
    assert result["sagittal_part_up", ("part", "database")] == 1
    assert result["sagittal_jobs", ("state", "queued")] == 0
    assert result["sagittal_backup_last_success_timestamp_seconds",] == timestamp.timestamp()
    assert result["sagittal_disk_free_bytes",] > 0
    assert CANARY not in text
    assert response.json()["id"] not in text
    dashboard = json.loads((ROOT / "docs" / "how-to" / "grafana-dashboard.json").read_text())
    requested_exprs = {t["expr"] for panel in dashboard["panels"] for t in panel["targets"]}
    names = {name for expr in requested_exprs for name in re.findall(r"(?:sagittal|process)_\w+", expr)}
    assert len(names) > 10
    assert names <= {name for name, *_ in result}
