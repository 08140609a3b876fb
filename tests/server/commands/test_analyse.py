"""Error messages of `sagittal analyse` name the wrong input."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.main import main


def test_a_folder_for_results_is_made_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "results"
    assert main(["analyse", str(tmp_path / "nothing"), "--out", str(out)]) == 1
    assert capsys.readouterr().err.startswith(f"{out}: Not a directory.")


def test_a_config_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config, out = tmp_path / "none.json", tmp_path / "results"
    assert main(["analyse", str(tmp_path), "--out", str(out), "--config", str(config)]) == 1
    assert f"{config} cannot be read as JSON: No such file or directory.\n" in capsys.readouterr().err
    assert not out.exists()
