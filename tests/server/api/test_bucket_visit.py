"""Visit with files in a bucket: upload, analysis, erasure, and an unavailable bucket."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import httpx
import pytest

from sagittal.core.simulate import Stand, Straight, mt_files, simulate
from sagittal.server.processes.supervisor import Workers
from sagittal.server.safekeeping import checks
from sagittal.server.safekeeping.sweep import sweep
from sagittal.server.storage.readiness import Readiness
from tests.helpers.buckets import Bucket, bucket, s3_server  # noqa: F401 - fixtures
from tests.helpers.clinic import Clinic, open_clinic

pytestmark = pytest.mark.anyio

API = "/api/v1"
FILM = b"\x1a\x45\xdf\xa3" + bytes(range(256)) * 8000
HTML = {"accept": "text/html"}


async def done(client: httpx.AsyncClient, answer: httpx.Response) -> None:
    """Wait until a job is over, which must have worked."""
    assert answer.status_code == 202, answer.text
    events = (await client.get(f"{API}/jobs/{answer.json()['id']}/events")).text.splitlines()
    states = [json.loads(line.removeprefix("data: ")) for line in events if line.startswith("data: ")]
    assert states[-1]["state"] == "done", states[-1]


async def walk(client: httpx.AsyncClient, path: str) -> None:
    """Upload and analyse a simulated walk with a video."""
    simulation = simulate((Stand(5.0), Straight(12.8, 0.64, 0.54), Stand(4.0)), seed=3)
    for name, content in mt_files(simulation.recording, "walk", simulation.first_counter).items():
        assert (await client.put(f"{path}/files/{name}", content=content)).status_code == 201
    await done(client, await client.post(f"{path}/inspections"))
    message = {"manifest": {"sensors": dict(simulation.recording.segments)}}
    await done(client, await client.post(f"{path}/analyses", json=message))
    await done(client, await client.post(f"{path}/exports", json={"kind": "xlsx"}))
    filmed = await client.put(f"{path}/video?name=a.webm&consent=true", content=FILM)
    assert filmed.status_code == 201


@pytest.mark.slow
async def test_a_visit_from_the_upload_to_its_erasure(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Readiness, "EVERY_S", 0.0)
    async with (
        open_clinic(tmp_path / "home", bucket=bucket.url, min_free_bytes=0, sweep_grace_s=0.0) as clinic,
        clinic.client("clinician", timeout=300, raises=False) as client,
    ):
        patient = (await client.post(f"{API}/patients", json={"code": "B-1", "height_m": 1.75})).json()["id"]
        session = (await client.post(f"{API}/patients/{patient}/sessions", json={})).json()["id"]
        path = f"{API}/sessions/{session}"
        workers = Workers(clinic.settings)
        workers.start()
        try:
            await walk(client, path)
        finally:
            workers.stop()
        assert all(key.startswith(f"blobs/{patient}/") for key in bucket.objects())
        local = [p for p in clinic.settings.blobs.rglob("*") if p.is_file()]
        assert [p.name for p in local] == ["bucket.txt"]
        await _read_all(client, path, patient, session)
        assert sweep(clinic.db, clinic.app.state.blobs, clinic.settings) == 0
        await _use_while_away(clinic, client, path, patient, session, bucket)
        assert checks.check(clinic.db, clinic.app.state.blobs, clinic.settings) == []
        async with clinic.client("admin") as admin:
            gone = await admin.delete(f"{API}/patients/{patient}?confirm=B-1")
        assert gone.status_code == 204, gone.text
        assert bucket.objects() == set()


async def _read_all(client: httpx.AsyncClient, path: str, patient: str, session: str) -> None:
    """Every way in which stored files are shown or given away."""
    report = (await client.get(f"{path}/report")).json()
    assert report["problem"] is None
    for page in ("", "/print", "/data", "/upload", "/calibration"):
        assert (await client.get(f"/sessions/{session}{page}", headers=HTML)).status_code == 200, page
    for name in ("parameters.csv", "tables", "archive.zip", "exports"):
        answer = await client.get(f"{path}/{name}")
        assert answer.status_code == 200, (name, answer.text[:300])
    exported = await client.get(f"{API}/patients/{patient}/export")
    with zipfile.ZipFile(io.BytesIO(exported.content)) as archive:
        assert archive.testzip() is None
        assert FILM in [archive.read(name) for name in archive.namelist()]
    film = f"{path}/video/content"
    whole = await client.get(film)
    assert (whole.status_code, whole.content) == (200, FILM)
    part = await client.get(film, headers={"range": "bytes=1000000-"})
    assert (part.status_code, part.content) == (206, FILM[1_000_000:])
    assert part.headers["content-range"] == f"bytes 1000000-{len(FILM) - 1}/{len(FILM)}"


async def _use_while_away(
    clinic: Clinic,
    client: httpx.AsyncClient,
    path: str,
    patient: str,
    session: str,
    bucket: Bucket,  # noqa: F811
) -> None:
    clinic.app.state.reviewed.forget()  # as after a restart
    assert (await client.get("/health/ready")).status_code in {200, 503}
    assert (await client.get("/health/ready")).json()["checks"]["files"] == "ok"
    bucket.server.stop()
    page = await client.get(f"/sessions/{session}", headers=HTML)
    assert (page.status_code, page.headers["retry-after"]) == (503, "5")
    assert "file storage is unavailable" in page.text
    assert bucket.name not in page.text
    for still in ("/patients", f"/patients/{patient}", f"/sessions/{session}/live"):
        assert (await client.get(still, headers=HTML)).status_code == 200, still
    requests: Any
    for method, label, requests in (
        ("GET", f"{path}/report", {}),
        ("GET", f"{path}/video/content", {}),
        ("GET", f"{path}/archive.zip", {}),
        ("PUT", f"{path}/files/other.txt", {"content": b"walk"}),
    ):
        answer = await client.request(method, label, **requests)
        assert (answer.status_code, answer.json()["code"]) == (503, "store_away"), label
    ready = await client.get("/health/ready")
    assert ready.status_code == 503
    assert ready.json()["checks"]["files"].startswith("The bucket of stored files cannot be reached;")
    bucket.server.start()
    assert (await client.get(f"/sessions/{session}", headers=HTML)).status_code == 200
    assert (await client.get("/health/ready")).json()["checks"]["files"] == "ok"
    assert "other.txt" not in [f["name"] for f in (await client.get(f"{path}/recording")).json()["files"]]
