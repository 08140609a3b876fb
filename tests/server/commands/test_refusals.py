"""What cannot be done is said in a sentence that names what was typed."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from server.main import main
from server.storage.compile_cache import VARIABLE


def test_a_key_in_a_folder_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keygen", str(tmp_path / "none" / "clinic.key")]) == 1
    said = capsys.readouterr().err
    assert (
        said == f"{tmp_path / 'none'}: No such file or directory. Check the path, its rights and the disk.\n"
    )


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


@pytest.mark.slow
def test_a_server_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        free = f"http://127.0.0.1:{s.getsockname()[1]}"
    assert main(["simulate", "--out", str(tmp_path), "--script", "swings_and_bows"]) == 0
    assert main(["replay", str(tmp_path / "recording.parquet"), "--to", free, "--code", "ABCDEF"]) == 1
    assert f"{free} cannot be reached (Connection refused); is the server running" in capsys.readouterr().err


def test_filters_are_not_compiled_into_a_folder_that_cannot_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "file" / "filters"))
    assert main(["warm"]) == 1
    assert "Check the path, its rights and the disk." in capsys.readouterr().err
