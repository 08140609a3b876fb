"""The service from the printed set-up address to the check: the same numbers as the command line."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.acceptance.test_cli import NEURA, result, sagittal
from tests.data import data_folder
from tests.helpers.service import Service, new_session, served, upload, wait_for


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with served(tmp_path_factory.mktemp("clinic") / "data") as running:
        yield running


@pytest.mark.slow
def test_a_set_up_address_works_once(service: Service) -> None:
    again = service.client.post(
        "/api/v1/set-up/guess", json={"name": "eve", "password": "long enough to pass"}
    )
    assert again.status_code == 404
    assert again.headers["content-type"] == "application/problem+json"


@pytest.mark.recorded
@pytest.mark.slow
def test_neura_walk_through_rest_equals_the_command_line(service: Service, tmp_path: Path) -> None:
    folder = data_folder("neura_walk", "rawimu")
    client = service.client
    session = new_session(client, "P-1 🚶")
    for file in sorted(folder.glob("*.txt")):
        upload(client, session, file.name, file.read_bytes())

    job = client.post(f"/api/v1/sessions/{session}/inspections").raise_for_status().json()
    assert wait_for(client, job["id"])["state"] == "done"
    found = client.get(f"/api/v1/sessions/{session}/recording").raise_for_status().json()
    assert len(found["files"]) == 11
    assert "duplicate" in json.dumps(found["inspection"])

    client.put(f"/api/v1/sessions/{session}/manifest", json={"sensors": NEURA["sensors"]}).raise_for_status()
    job = client.post(f"/api/v1/sessions/{session}/analyses", json={}).raise_for_status().json()
    last = wait_for(client, job["id"])
    assert last["state"] == "done", last
    analyses = client.get(f"/api/v1/sessions/{session}/analyses").raise_for_status().json()
    address = f"/api/v1/analyses/{analyses[0]['id']}/files"
    report = client.get(f"{address}/analysis.json").raise_for_status().json()

    known = client.get("/api/v1/devices").raise_for_status().json()
    worn = {d["device_id"]: d["last_segment"] for d in known}
    assert worn.items() <= NEURA["sensors"].items()  # type: ignore[attr-defined]  # of JSON
    assert len(worn) == 7
    assert {d["checks"][0]["reason"] for d in known} == {None}

    manifest = tmp_path / "manifest.json"
    manifest.write_text(json.dumps(NEURA), "utf-8")
    done = sagittal("analyse", folder, "--manifest", manifest, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert report["parameters"] == result(tmp_path / "out")["parameters"]
    for name in (
        "angles.parquet",
        "poses.parquet",
        "tracks.parquet",
        "signals.parquet",
        "events.csv",
        "strides.csv",
    ):
        assert client.get(f"{address}/{name}").content == (tmp_path / "out" / name).read_bytes(), name


@pytest.mark.slow
def test_an_unreadable_recording_fails_with_a_sentence_and_the_next_one_works(service: Service) -> None:
    client = service.client
    session = new_session(client, "P-2")
    upload(client, session, "notes.txt", b"dear diary, today nobody walked\n")
    job = client.post(f"/api/v1/sessions/{session}/analyses", json={}).raise_for_status().json()
    last = wait_for(client, job["id"])
    assert last["state"] == "failed"
    assert len(last["error_message"] or last["message"]) > 30
    assert client.get(f"/sessions/{session}").status_code == 200


@pytest.mark.slow
def test_the_server_ends_within_ten_seconds_and_all_is_well(service: Service) -> None:
    service.process.send_signal(signal.SIGTERM)
    assert service.process.wait(timeout=10) == 0
    checked = sagittal("check", "--data", service.folder)
    assert checked.returncode == 0, checked.stdout
    assert "All is well" in checked.stdout
