from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.simulate import MOVEMENTS, SCRIPTS
from sagittal.server.commands.science.simulate import simulate


def _rows(file: Path) -> list[dict[str, str]]:
    with file.open() as lines:
        return list(csv.DictReader(lines))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "truth", "protocol"),
    [
        ("drop_foot", {"angles.parquet", "events.csv", "strides.csv", "truth.json"}, "walk"),
        ("squats_left", {"angles.parquet", "phases.csv", "truth.json"}, "squat"),
        ("tug_parkinson", {"trunk.csv", "segments.csv", "scripted.csv", "truth.json"}, "tug"),
        ("chair_rises", {"trunk.csv", "phases.csv", "truth.json"}, "activity"),
    ],
)
def test_every_kind_of_script_writes_its_recording_and_its_truth(
    tmp_path: Path, script: str, truth: set[str], protocol: str
) -> None:
    assert simulate(out=tmp_path, script=script, seed=3) == 0
    assert {f.name for f in (tmp_path / "truth").iterdir()} == truth
    document = json.loads((tmp_path / "truth" / "truth.json").read_bytes())
    assert (document["script"], document["seed"]) == (script, 3)
    file = tmp_path / "recording.parquet"
    recording = read_recording([SourceFile(file.name, file.stat().st_size, file.read_bytes)], None)
    assert recording.protocol == protocol


def test_five_rises_are_five_rises(tmp_path: Path) -> None:
    simulate(out=tmp_path, script="chair_rises", seed=1)
    kinds = [row["kind"] for row in _rows(tmp_path / "truth" / "phases.csv")]
    assert kinds.count("sit_to_stand") == kinds.count("stand_to_sit") == 5
    pitch = [float(row["trunk_pitch_deg"]) for row in _rows(tmp_path / "truth" / "trunk.csv")]
    assert 35.0 < max(pitch) < 45.0


def test_an_unknown_script_is_answered_with_all_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert simulate(out=tmp_path, script="moonwalk", seed=1) == 2
    stderr = capsys.readouterr().err
    assert all(name in stderr for name in (*SCRIPTS, *MOVEMENTS))
    assert not any(tmp_path.iterdir())
