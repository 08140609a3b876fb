"""Exports over the API and on the page: request, worker, download, renewal."""

from __future__ import annotations

import base64
import csv
import io
import zipfile
from typing import Any

import pytest

from sagittal.core.formats.source import SourceFile
from sagittal.server.commands.export import export
from sagittal.server.downloads import exports
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import EXPORT
from sagittal.server.main import main
from sagittal.server.results import analyses
from tests.helpers.clinic import Clinic
from tests.helpers.engines import on_both_engines
from tests.server import analysed

pytestmark = [pytest.mark.anyio, on_both_engines]

API = "/api/v1"


async def visit(clinic: Clinic, code: str) -> str:
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": code})).json()["id"]
        requests = {"title": "Walk", "performed_on": "2026-03-02"}
        session: str = (await client.post(f"{API}/patients/{patient}/sessions", json=requests)).json()["id"]
    analysed.finish(clinic, patient, session, analysed.files())
    return session


QUIET = Attempt(lambda stage, share, message=None: None, lambda content: None)


def work(clinic: Clinic, session: str) -> None:
    """Run the next job like a worker and its child, in this process."""
    state = clinic.app.state
    claim = state.queue.claim("tester", [EXPORT])
    with clinic.db.read() as c:
        space = analyses.get_shown(c, session).patient_id
    files = [
        SourceFile(f["name"], f["size"], lambda f=f: state.blobs.read(space, f["sha256"]))  # type: ignore[misc]
        for f in claim.params["files"]
    ]
    results = exports.run(files, claim.params, QUIET)
    stored = {name: state.blobs.put(space, content) for name, content in results.items()}
    assert state.queue.finish(claim, lambda c: exports.publish(c, claim, results, stored))


@pytest.mark.slow
async def test_an_export_is_written_once_and_anew_after_an_edit(clinic: Clinic) -> None:
    session = await visit(clinic, "exported")
    path = f"{API}/sessions/{session}"
    async with clinic.client("viewer") as client:

        async def offered() -> dict[str, Any]:
            return {offer["kind"]: offer for offer in (await client.get(f"{path}/exports")).json()}

        async def strides() -> list[dict[str, str]]:
            offer = (await offered())["csv"]
            answer = await client.get(f"{API}/analyses/{offer['analysis_id']}/files/{offer['file']}")
            text = zipfile.ZipFile(io.BytesIO(answer.content)).read("strides_wide.csv").decode()
            return list(csv.DictReader(io.StringIO(text)))

        assert (await offered())["csv"]["job"] is None
        requested_response = await client.post(f"{path}/exports", json={"kind": "csv"})
        assert (requested_response.status_code, requested_response.json()["kind"]) == (202, "export")
        assert (await client.post(f"{path}/exports", json={"kind": "csv"})).json()[
            "id"
        ] == requested_response.json()["id"]
        assert 'job="' in (await client.get(f"/sessions/{session}/data")).text
        work(clinic, session)
        initial = await strides()
        page = (await client.get(f"/sessions/{session}/data")).text
        assert "Export for other programs" in page
        assert page.count((await offered())["csv"]["file"]) == 1, "not among the results, too"

        item = next(row for row in initial if row["counted"] == "1")
        edit = {"kind": "exclude_stride", "side": item["side"], "reason": "stumbled"}
        edit["time_s"] = (float(item["start_s"]) + float(item["end_s"])) / 2  # type: ignore[assignment]
        async with clinic.client("clinician") as clinician:
            assert (await clinician.post(f"{path}/edits", json=edit)).status_code == 201
        assert (await offered())["csv"]["job"] is None, "the one before the edit is not offered"
        await client.post(f"{path}/exports", json={"kind": "csv"})
        work(clinic, session)
        left_out = [row["cycle"] for row in await strides() if row["excluded_reason"] == "manual:stumbled"]
        assert left_out == [item["cycle"]]

    async with clinic.client("assistant") as client:
        assert (await client.post(f"{path}/exports", json={"kind": "csv"})).status_code == 403


@pytest.mark.slow
async def test_the_signed_report_goes_into_the_bundle_and_only_there(clinic: Clinic) -> None:
    session = await visit(clinic, "handed-on")
    path = f"{API}/sessions/{session}"
    async with clinic.client("clinician") as client:

        async def offered(kind: str) -> dict[str, Any]:
            offers = (await client.get(f"{path}/exports")).json()
            return next(offer for offer in offers if offer["kind"] == kind)

        for kind in ("fhir", "xlsx"):
            await client.post(f"{path}/exports", json={"kind": kind})
            work(clinic, session)
        signed = (await client.post(f"/sessions/{session}/report/sign", json={})).json()
        assert (await offered("xlsx"))["file"] is not None
        assert (await offered("fhir"))["job"] is None, "the one before the signature is not offered"
        await client.post(f"{path}/exports", json={"kind": "fhir"})
        work(clinic, session)
        offer = await offered("fhir")
        bundle = (await client.get(f"{API}/analyses/{offer['analysis_id']}/files/{offer['file']}")).json()
        document = (await client.get(f"/signed-reports/{signed['id']}")).content
    report = next(
        entry["resource"]
        for entry in bundle["entry"]
        if entry["resource"]["resourceType"] == "DiagnosticReport"
    )
    assert report["status"] == "final"
    (form,) = report["presentedForm"]
    assert form["contentType"] == "text/html"
    assert base64.b64decode(form["data"]) == document


async def test_what_cannot_be_exported_is_refused(clinic: Clinic) -> None:
    session = await visit(clinic, "refused")
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/sessions/{session}/exports", json={"kind": "docx"})
        assert answer.status_code == 422
        assert (await client.get(f"{API}/sessions/{'0' * 32}/exports")).status_code == 404


def test_the_command_line_writes_the_same_from_a_folder(tmp_path: Any, capsys: Any) -> None:
    for name, content in analysed.files().items():
        (tmp_path / name).write_bytes(content)
    assert export(tmp_path, kind="csv", code="p1") == 0
    assert export(tmp_path, kind="opensim", code="p1") == 0
    names = zipfile.ZipFile(tmp_path / "export-csv.zip").namelist()
    assert "strides_long.csv" in names
    assert zipfile.ZipFile(tmp_path / "export-opensim.zip").namelist() != names
    assert export(tmp_path / "nowhere", kind="csv", code="p1") == 1
    assert "holds no analysis.json" in capsys.readouterr().err
    words = ["export", str(tmp_path), "--as", "csv", "--out", str(tmp_path / "analysis.json" / "x.zip")]
    assert main(words) == 1
    assert "Check the path" in capsys.readouterr().err
