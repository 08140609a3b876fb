"""`sagittal sensitivity`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from sagittal.core.angles import JointAngles
from sagittal.core.formats import write_recording
from sagittal.core.simulate.mems import MEMS
from sagittal.server.main import main
from sagittal.server.report.files.exports import angles_parquet
from tests.core.body.chain.squats import squat_on


@pytest.fixture(scope="module")
def take(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One squat, and its truth as an optical system would give it."""
    folder = tmp_path_factory.mktemp("take")
    simulation = squat_on("right", 50.0, MEMS, repetitions=1)
    truth = JointAngles(
        simulation.truth.t_s, simulation.truth.subtract_standing(), simulation.truth.zero_offset
    )
    (folder / "recording.parquet").write_bytes(write_recording(simulation.recording))
    (folder / "angles.parquet").write_bytes(angles_parquet(truth))
    (folder / "truth.json").write_text('{"t_s": 1}')
    return folder


@pytest.mark.slow
def test_a_take_with_a_reference_gives_the_tables(
    take: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    measures, out = tmp_path / "measures.json", tmp_path / "out" / "all.csv"
    measures.write_text(json.dumps({"tibia": 0.42, "thigh": 0.42}))
    call = [
        "sensitivity",
        str(take / "recording.parquet"),
        "--reference",
        str(take / "angles.parquet"),
    ]
    assert main([*call, "--measures", str(measures), "--out", str(out)]) == 0
    message = capsys.readouterr().out.splitlines()
    assert sum(line.startswith("LTib2Knee") for line in message) == 4
    assert sum(line.startswith("Yaw-bac") for line in message) == 4
    with out.open() as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 24 * 7
    assert all(float(row["error_deg"]) < 3.0 for row in rows)
    tilted = next(r for r in rows if r["parameter"] == "Yaw-thi" and r["angle"] == "knee_flexion")
    assert 1.0 < float(tilted["delta_step_deg"]) < 2.5
    assert (tilted["sensitivity_pct"], tilted["reason"]) == ("", "parameter_nominal_zero")


TAKE = "{take}/recording.parquet"
TRUE = ("--reference", "{take}/angles.parquet")


@pytest.mark.parametrize(
    ("call", "code", "said"),
    [
        ((TAKE, "--reference", "{take}/none.parquet"), 1, "file_not_found"),
        ((TAKE, "--reference", "{take}/truth.json"), 1, "reference_unreadable"),
        ((TAKE, *TRUE, "--side", "left"), 1, "segments_missing"),
        ((TAKE, *TRUE, "--table-top", TAKE), 1, "table_orientation"),
        ((TAKE, *TRUE, "--measures", "{take}/truth.json"), 1, "measures_unreadable"),
        ((TAKE, *TRUE, "--measures", TAKE), 1, "measures_unreadable"),
    ],
)
def test_what_is_missing_is_said(
    take: Path, call: tuple[str, ...], code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sensitivity", *(word.format(take=take) for word in call)]) == code
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_a_take_alone_is_held_against_itself(take: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sensitivity", str(take / "recording.parquet"), "--from-standing"]) == 0
    stdout = capsys.readouterr().out
    assert "RMS change of the angles in °" in stdout
    assert "RMS error" not in stdout
    assert "sensitivity in %" not in stdout
