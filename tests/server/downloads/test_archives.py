"""The archive of a visit: another Sagittal reads it and comes to the same numbers."""

from __future__ import annotations

import datetime as dt
import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from sagittal.core.errors import ArchiveError
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.simulate import simulate_scenario
from sagittal.core.simulate.mt_text import mt_files
from sagittal.server.downloads import archives
from sagittal.server.results import analysing
from sagittal.server.results.analyses import AnalysisRecord
from sagittal.server.results.edit_log import EditHistory
from sagittal.server.sharing.signed_reports import SignedDocuments, SignedReport
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.uploads.recordings import RecordedFile, StoredRecording
from tests.core.formats.making import zipped

SPACE = "0" * 32
CONFIG = {"poses": {"least_valid": 0.7}}


def visit(
    store: FolderBlobs,
    files: Mapping[str, bytes],
    manifest: dict[str, Any],
    results: Mapping[str, bytes],
    config: Mapping[str, Any] = CONFIG,
) -> bytes:
    """An archive of these original files."""
    retained = [RecordedFile(name, len(data), store.put(SPACE, data).sha256) for name, data in files.items()]
    recording = StoredRecording("r", "s", SPACE, "ready", tuple(retained), manifest, None, None)
    analysis_record = AnalysisRecord(
        "a", "r", "s", SPACE, "j", "", "", "source", manifest, config, dt.datetime(2026, 1, 2, tzinfo=dt.UTC),
        {name: store.put(SPACE, data) for name, data in results.items()},
    )  # fmt: skip
    out = io.BytesIO()
    archives.write_archive(
        out, store, recording, analysis_record, EditHistory(), {"parameters.csv": b"name\n"}, signed(store)
    )
    return out.getvalue()


def signed(store: FolderBlobs) -> SignedDocuments:
    """A signed report of that analysis with its PDF."""
    timestamp = dt.datetime(2026, 1, 3, tzinfo=dt.UTC)
    html, pdf = (store.put(SPACE, text) for text in (b"<p>Signed</p>", b"%PDF-1.7"))
    report = SignedReport("p", "s", 1, "a", "en", "Therapist 1", timestamp, None, None, None, html.sha256)
    return SignedDocuments(report, {"report.html": html, "report.pdf": pdf})


@pytest.mark.slow
def test_an_archive_is_analysed_to_the_same_bits(tmp_path: Path) -> None:
    output = simulate_scenario("comfortable", 1).recording
    files = mt_files(output, "walk")
    by_device = {device: segment for device, segment in output.segments.items() if segment is not None}
    manifest = {"subject": {"height_m": 1.75}, "protocol": "walk"}
    # one zip with a manifest of its own, as a person may have uploaded it
    upload = {"walk.zip": zipped(files | {"manifest.json": json.dumps({"sensors": by_device}).encode()})}
    sources = [SourceFile.of_bytes(name, data) for name, data in upload.items()]
    results = analysing.run(sources, json.dumps(manifest).encode(), CONFIG, lambda stage, share: None)
    archive = visit(FolderBlobs(tmp_path / "blobs"), upload, manifest, results)

    with zipfile.ZipFile(io.BytesIO(archive)) as opened:
        names = set(opened.namelist())
        document = json.loads(opened.read("sagittal-episode.json"))
        assert opened.read("results/analysis.json") == results["analysis.json"]
    assert {f"recording/{name}" for name in files} < names
    assert document["sha256"].keys() == names - {"sagittal-episode.json"}

    second_result = analysing.run(
        [SourceFile.of_bytes("visit.zip", archive)], None, None, lambda stage, share: None
    )
    first, second = (json.loads(result["analysis.json"]) for result in (results, second_result))
    assert second["parameters"] == first["parameters"]
    assert any(p["mean"] is not None for p in first["parameters"])
    assert second["provenance"]["parameters_sha256"] == first["provenance"]["parameters_sha256"]
    assert second_result["strides.csv"] == results["strides.csv"]
    assert second_result["angles.parquet"] == results["angles.parquet"]


def test_results_in_an_archive_are_not_read_as_recordings(tmp_path: Path) -> None:
    table = b"acc_x,acc_y,acc_z\n" + b"0,0,9.81\n" * 10
    manifest = {
        "sources": [
            {"file": "a.csv", "rate_hz": 100, "acc_unit": "m/s2",
             "columns": {"pelvis": {"acc": ["acc_x", "acc_y", "acc_z"]}}},
        ],
    }  # fmt: skip
    store = FolderBlobs(tmp_path / "blobs")
    archive = visit(store, {"a.csv": table}, manifest, {"angles.parquet": b"PAR1", "strides.csv": table})
    recording = read_recording([SourceFile.of_bytes("visit.zip", archive)])
    assert dict(recording.segments) == {"pelvis": "pelvis"}
    assert not recording.notices
    assert (
        visit(store, {"a.csv": table}, manifest, {"angles.parquet": b"PAR1", "strides.csv": table}) == archive
    )
    with zipfile.ZipFile(io.BytesIO(archive)) as opened:
        assert opened.read("report/report.html") == b"<p>Signed</p>"
        assert opened.read("report/report.pdf") == b"%PDF-1.7"
        document = json.loads(opened.read("sagittal-episode.json"))["signed_report"]
    assert (document["version"], document["signed_by"], document["of_these_numbers"]) == (
        1,
        "Therapist 1",
        True,
    )


def test_an_archive_of_an_archive_has_its_settings_and_the_newest_manifest(tmp_path: Path) -> None:
    table = b"acc_x,acc_y,acc_z\n" + b"0,0,9.81\n" * 10
    columns = {"a": {"acc": ["acc_x", "acc_y", "acc_z"]}}
    source = {"file": "a.csv", "rate_hz": 100, "acc_unit": "m/s2", "columns": columns}
    store = FolderBlobs(tmp_path / "blobs")
    first = {"sources": [source], "sensors": {"a": "pelvis"}, "subject": {"height_m": 1.7}}
    archive = visit(store, {"a.csv": table}, first, {})
    # somebody puts right who wears what, and it is handed on twice
    for notices in ({"sensors": {"a": "chest"}}, {}, {"protocol": "walk"}):
        archive = visit(store, {"visit.zip": archive}, notices, {}, {})
    file = SourceFile.of_bytes("visit.zip", archive)
    assert analysing.choose_config([file], None) == CONFIG
    recording = read_recording([file])
    assert dict(recording.segments) == {"a": "chest"}
    assert recording.subject.height_m == 1.7
    assert not recording.notices


def test_an_archive_without_settings_says_so() -> None:
    archive = SourceFile.of_bytes("visit.zip", zipped({"sagittal-episode.json": b"{}", "recording/a": b"x"}))
    with pytest.raises(ArchiveError):
        analysing.analyse_files([archive], None, None, lambda stage, share: None)
