"""`sagittal stairs`: from a walk on stairs to an analysis with the person's own limits."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sagittal.core.formats import write_recording
from sagittal.core.simulate.chest import Day, PostureHold, simulate_day
from sagittal.core.simulate.setup import RecordingSetup
from sagittal.server.commands.analyse import analyse
from sagittal.server.commands.science.stairs import stairs

WALKED: Day = (
    PostureHold("stand", 10.0),
    PostureHold("walk", 40.0),
    PostureHold("stand", 10.0),
    PostureHold("stairs_up", 30.0),
    PostureHold("stand", 10.0),
    PostureHold("stairs_down", 30.0),
    PostureHold("stand", 10.0),
    PostureHold("bow", 3.0),
    PostureHold("stand", 6.0),
    PostureHold("bow", 3.0),
    PostureHold("stand", 6.0),
    PostureHold("bow", 3.0),
    PostureHold("stand", 6.0),
)


def steps_down(out: Path) -> int:
    document = json.loads((out / "activity.json").read_bytes())
    return sum(bout["stairs_down_steps"] for bout in document["bouts"])


@pytest.mark.slow
def test_own_limits_find_the_stairs_that_the_common_ones_miss(tmp_path: Path) -> None:
    day = simulate_day(WALKED, 1.7, 3, RecordingSetup(rate_hz=50.0))
    file = tmp_path / "walk.parquet"
    file.write_bytes(write_recording(day.recording))
    walks = {p.kind: (p.start_s, p.end_s) for p in day.truth.phases}
    own = tmp_path / "own.json"
    assert stairs([file], level=walks["walk"], up=walks["stairs_up"], down=walks["stairs_down"], out=own) == 0
    analyse([file], out=tmp_path / "common")
    analyse([file], out=tmp_path / "own", config=own)
    true = sum(walks["stairs_down"][0] <= t <= walks["stairs_down"][1] for t in day.truth.steps_s)
    assert steps_down(tmp_path / "common") <= 0.2 * true
    assert steps_down(tmp_path / "own") >= 0.7 * true


def test_too_few_steps_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    day = simulate_day(WALKED[:3], 1.7, 3, RecordingSetup(rate_hz=50.0))
    file = tmp_path / "walk.parquet"
    file.write_bytes(write_recording(day.recording))
    none = (0.0, 5.0)
    assert stairs([file], level=(10.0, 50.0), up=none, down=none, out=tmp_path / "own.json") == 1
    assert "walk_too_short" in capsys.readouterr().err
