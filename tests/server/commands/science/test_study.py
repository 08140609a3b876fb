"""`sagittal study`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from sagittal.core.formats import write_recording
from sagittal.core.simulate import simulate_scenario
from sagittal.server.main import main
from tests.core.formats import vendor_files as made

pytestmark = pytest.mark.sweep


def test_a_folder_becomes_two_tables_and_a_list_of_failures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "study", tmp_path / "out"
    (folder / "one").mkdir(parents=True)
    (folder / "one" / "walk.parquet").write_bytes(
        write_recording(simulate_scenario("comfortable", 1).recording)
    )
    for name, data in made.bids_parts(types=("POS", "ORNT")).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    call = ["study", str(folder), "--out", str(out), "--jobs", "1"]
    assert main(call) == 0
    assert "1 of 2 takes analysed" in capsys.readouterr().out

    takes = pq.read_table(out / "takes.parquet").to_pylist()
    assert [t["take"] for t in takes] == ["one/walk.parquet", "sub-01/motion/sub-01_task-walk"]
    assert [t["error"] for t in takes] == [None, "missing_acc"]
    assert (takes[1]["sub"], takes[1]["task"]) == ("01", "walk")
    assert takes[0]["estimated_angles"] is None  # every segment wore a sensor
    assert 0.9 < takes[0]["gait_speed_mps"] < 1.6
    strides = pq.read_table(out / "strides.parquet")
    with (out / "strides.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == strides.num_rows > 10
    assert strides["stride_time_s"].to_pylist()[0] == pytest.approx(float(rows[0]["stride_time_s"]))
    with (out / "failures.csv").open(newline="") as lines:
        (failed,) = csv.DictReader(lines)
    assert failed["code"] == "missing_acc"
    assert "POS" in failed["message"]
    provenance = json.loads((out / "provenance.json").read_bytes())
    assert list(provenance["takes"]["one/walk.parquet"]["sha256"]) == ["walk.parquet"]

    states = {p: p.stat().st_mtime_ns for p in out.rglob("state.json")}
    assert main(call) == 0
    assert {p: p.stat().st_mtime_ns for p in out.rglob("state.json")} == states
    (folder / "one" / "walk.parquet").write_bytes(b"PAR1 no more")
    assert main(call) == 1
    assert sum(p.stat().st_mtime_ns != position for p, position in states.items()) == 1


def test_a_folder_without_recordings_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "No recording was found" in capsys.readouterr().err
