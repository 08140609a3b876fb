"""`sagittal bench`."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.main import main
from tests.core.fusion.algorithms.motion import trial_bytes


def test_the_command_lists_the_37(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "fusion", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 38
    assert sum("reconstruction" in line for line in lines) == 4
    assert "doi:10.1109/TAC.2008.923738" in "".join(lines)


def test_the_command_needs_a_folder_with_recordings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "fusion"]) == 2
    assert main(["bench", "fusion", str(tmp_path)]) == 1
    (tmp_path / "a.npz").write_bytes(b"nothing")
    assert main(["bench", "fusion", str(tmp_path)]) == 1
    assert "does not hold" in capsys.readouterr().err


@pytest.mark.sweep
def test_the_command_scores_every_algorithm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, content in (("a", trial_bytes()), ("b", trial_bytes(rest_s=0.5))):
        (tmp_path / f"{name}.npz").write_bytes(content)
    out = tmp_path / "scores" / "all.csv"
    assert main(["bench", "fusion", str(tmp_path), "--out", str(out), "--every"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2 + 2 * 39
    rows = out.read_text("utf-8").splitlines()
    assert len(rows) == 1 + 2 * 39
    assert "less than 1 s of rest" in rows[2]
    assert main(["bench", "fusion", str(tmp_path)]) == 0
    visible_stdout = capsys.readouterr().out
    assert "mean of 1 of 2" in visible_stdout
