"""Every command but `serve` runs in a bare container of the image: bound everywhere, no TLS setting."""

from __future__ import annotations

import io
import shlex
import socket
from pathlib import Path

import pytest

from sagittal.server.main import COMMANDS, main
from sagittal.server.storage.compile_cache import VARIABLE
from tests.test_packaging import last

IMAGE = dict(part.split("=", 1) for part in shlex.split(last("ENV")))

ARGUMENTS = {
    "serve": [],
    "worker": [],
    "demo": ["--port", "{port}"],  # in use: it gets as far as listening
    "analyse": ["{none}", "--out", "{none}"],
    "export": ["{none}", "--as", "csv"],
    "study": ["{none}", "--out", "{none}"],
    "stairs": ["{none}", "--level", "0", "1", "--up", "1", "2", "--down", "2", "3", "--out", "{none}"],
    "replay": ["{none}", "--to", "http://127.0.0.1:{port}", "--code", "ABCDEF"],
    "simulate": ["--out", "{out}", "--script", "none"],
    "bench": ["fusion", "--list"],
    "sensitivity": ["{none}"],
    "tune": ["{none}", "--algorithm", "madgwick", "--validate", "none"],
    "check": [],
    "backup": ["{out}"],
    "restore": ["{none}"],
    "keygen": ["{out}/clinic.key"],
    "identity-key": ["make"],
    "trash": [],
    "research": ["{out}/research.zip", "--key", "{out}/research.key"],
    "adopt": [],
    "accept": [],
    "migrate": [],
    "move-database": [],
    "move-blobs": [],
    "warm": [],
    "user": ["anna"],
}
"""What each command is called with: enough to read its settings, and little to do."""


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_runs_in_a_bare_container(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    data.mkdir()
    out.mkdir()
    for name, value in (IMAGE | {"SAGITTAL_HOME": str(data)}).items():
        if name.startswith("SAGITTAL_"):
            monkeypatch.setenv(name, value)
    assert IMAGE["SAGITTAL_HOST"] == "0.0.0.0"  # noqa: S104 - never bound here
    assert "SAGITTAL_BEHIND_TLS" not in IMAGE
    # compiling takes minutes: `warm` ends at a folder that cannot be made
    (tmp_path / "file").touch()
    if command == "warm":
        monkeypatch.setenv(VARIABLE, str(tmp_path / "file" / "filters"))
    monkeypatch.setattr("sys.stdin", io.StringIO("correct horse battery\n"))
    with socket.socket() as selection:
        selection.bind(("127.0.0.1", 0))
        selection.listen()
        words = {"port": selection.getsockname()[1], "none": tmp_path / "none", "out": out}
        code = main([command, *(word.format(**words) for word in ARGUMENTS[command])])
    refused = "unencrypted" in capsys.readouterr().err
    assert refused == (command == "serve")
    assert code == 2 or not refused
