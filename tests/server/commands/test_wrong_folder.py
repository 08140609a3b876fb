"""Commands with a wrong folder report it and create no clinic."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from sagittal.server.main import main

COMMANDS = (
    ["check"],
    ["backup", "backups"],
    ["identity-key", "make"],
    ["accept"],
    ["migrate"],
    ["adopt"],
    ["trash", "--restore"],
    ["trash"],
    ["research", "out.zip", "--key", "research.key"],
    ["worker"],
)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_no_clinic_begins_in_a_wrong_folder(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    wrong = tmp_path / "wrong"
    wrong.mkdir()
    assert main([*command, "--data", str(wrong)]) == 1
    assert f"There is no database in {wrong}; give the folder with --data.\n" in capsys.readouterr().err
    assert not (wrong / "sagittal.db").exists()
    if command in (["trash"], ["accept"]):  # which only read
        assert list(wrong.iterdir()) == []


@pytest.mark.slow
def test_a_user_of_a_new_clinic_is_told_that_it_is_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for message in (f"There was no database in {tmp_path}: a new clinic begins there.\n", ""):
        monkeypatch.setattr("sys.stdin", io.StringIO("correct horse battery\n"))
        assert main(["user", "anna", "--role", "admin", "--data", str(tmp_path)]) == 0
        assert capsys.readouterr().out == f"{message}anna can sign in.\n"


@pytest.mark.parametrize("command", ["serve", "check", "worker"])
def test_a_file_in_place_of_the_folder_is_named(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.touch()
    assert main([command, "--data", str(file)]) == 2
    assert capsys.readouterr().err == f"data_dir is '{file}', a file, expected a folder.\n"
