"""`sagittal tune`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sagittal.core.fusion.algorithms.tuning import GainTuner
from sagittal.server.main import main
from tests.core.fusion.algorithms.motion import trial_bytes

SMALL = ["--particles", "3", "--iterations", "2", "--rounds", "2", "--random-rounds", "1"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, seconds in (("a", 2.0), ("b", 2.5), ("judge", 3.0)):
        (tmp_path / f"{name}.npz").write_bytes(trial_bytes(seconds))
    (tmp_path / "notes.txt").write_text("of no use")
    return tmp_path


def tune(folder: Path, *more: str) -> int:
    inputs = ["tune", str(folder), "--algorithm", "mahony_2008", "--out", str(folder / "out" / "tuned.json")]
    return main([*inputs, "--validate", "judge", *SMALL, *more])


def test_the_gains_are_written_with_what_they_were_fitted_to(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert tune(folder, "--scheme", "fixed", "--no-magnetometer") == 0
    written = json.loads((folder / "out" / "tuned.json").read_bytes())
    assert set(written["data"]) == {"a", "b", "judge"}
    assert set(written["trained"]) == {"a", "b"}
    assert written["magnetometer"] is False
    assert list(written["gains"]) == ["kp", "ki"]
    captured = capsys.readouterr()
    assert written["verdict"] in captured.out
    assert "100.0 %" in captured.err
    assert not list((folder / "out").glob("*.checkpoint"))


def test_what_is_interrupted_is_resumed_to_the_same_numbers(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert tune(folder) == 0
    whole = (folder / "out" / "tuned.json").read_bytes()
    say = GainTuner._say

    def interrupt(self: GainTuner, swarm: object) -> str:
        if swarm.step == 4:  # type: ignore[attr-defined]
            raise KeyboardInterrupt
        return say(self, swarm)  # type: ignore[arg-type]

    with monkeypatch.context() as patched:
        patched.setattr(GainTuner, "_say", interrupt)
        assert tune(folder) == 130
    checkpoint = folder / "out" / "tuned.json.checkpoint"
    assert f"--resume {checkpoint}" in capsys.readouterr().err
    assert tune(folder, "--resume", str(checkpoint)) == 0
    assert (folder / "out" / "tuned.json").read_bytes() == whole
    checkpoint.write_bytes(b"of another")
    assert tune(folder, "--resume", str(checkpoint)) == 1
    assert "is no checkpoint" in capsys.readouterr().err


def test_a_split_that_is_none_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert tune(folder, "--validate", "a", "b", "judge") == 1
    assert "at least one of each is needed" in capsys.readouterr().err
    assert tune(folder, "--validate", "nobody") == 1
    assert "No trial nobody" in capsys.readouterr().err
    (folder / "copy.npz").write_bytes((folder / "judge.npz").read_bytes())
    assert tune(folder) == 1
    assert "the same recording" in capsys.readouterr().err
