"""`sagittal keygen`."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.commands.keygen import keygen
from sagittal.server.main import main
from sagittal.server.storage.archive import read_key


def test_the_new_key_is_said_with_its_public_half_which_alone_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "clinic.key"
    assert keygen(path) == 0
    stdout = capsys.readouterr().out
    assert stdout.startswith(f"{path} holds the clinic's key. Without it no encrypted backup can be read")
    public = stdout.rsplit("Public key, which only encrypts: ", 1)[1].strip()
    assert public.startswith("age1")
    assert "AGE-SECRET-KEY" not in stdout
    assert "AGE-SECRET-KEY" in path.read_text()
    assert read_key(path)


def test_a_key_that_is_there_is_never_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("clinic.key").write_text("the only copy")
    assert keygen(Path("clinic.key")) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert str(tmp_path / "clinic.key") in captured.err
    assert Path("clinic.key").read_text() == "the only copy"


def test_a_key_in_a_folder_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keygen", str(tmp_path / "none" / "clinic.key")]) == 1
    stderr = capsys.readouterr().err
    assert (
        stderr
        == f"{tmp_path / 'none'}: No such file or directory. Check the path, its rights and the disk.\n"
    )
