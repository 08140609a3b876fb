"""`sagittal warm`: after it the first analysis finds its filters."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.main import main
from sagittal.server.storage.compile_cache import VARIABLE, has_compiled_filters


@pytest.mark.sweep
def test_warm_goes_through_every_step_and_leaves_filters(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["warm"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line[:6] for line in lines[1:]] == ["1 of 2", "2 of 2"]
    assert has_compiled_filters()


def test_filters_are_not_compiled_into_a_folder_that_cannot_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "file" / "filters"))
    assert main(["warm"]) == 1
    assert "Check the path, its rights and the disk." in capsys.readouterr().err
