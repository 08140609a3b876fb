"""`sagittal replay`: invalid options, and the message after a finished trial."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest

from sagittal.server.commands.replay import _heard, _summary, replay
from sagittal.server.live.client import StreamReport
from sagittal.server.live.playback import DueBatch
from sagittal.server.main import main

NOBODY = "http://127.0.0.1:9"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"speed": -0.5}, "--speed is -0.5; expected 0 or more."),
        ({"speed": float("inf")}, "--speed is inf; expected 0 or more."),
        ({"drop": 1.0}, "--drop is 1; expected 0 to below 1."),
        ({"drop": -0.1}, "--drop is -0.1; expected 0 to below 1."),
        ({"jitter": -1.0}, "--jitter is -1; expected 0 or more milliseconds."),
        ({"jitter": float("nan")}, "--jitter is nan; expected 0 or more milliseconds."),
    ],
)
def test_an_option_out_of_range_is_named_before_anything_is_read(
    options: dict[str, Any], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert replay([Path("none")], to=NOBODY, code="ABCDEF", **options) == 1
    assert capsys.readouterr().err == f"Not replayed (bad_option): {said}\n"


def test_the_ends_of_the_ranges_are_allowed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "walk.txt").write_text("no recording")
    assert replay([tmp_path / "walk.txt"], to=NOBODY, code="ABCDEF", speed=0.0, drop=0.0, jitter=0.0) == 1
    stderr = capsys.readouterr().err
    assert stderr.startswith("Not replayed (")
    assert "bad_option" not in stderr


def report(**changes: Any) -> StreamReport:
    known_fields: dict[str, Any] = {"sent": 3, "recording": "r1", "sha256": "0123456789abcdef"}
    return StreamReport(**(known_fields | changes))


BATCHES = [DueBatch(float(i), b"") for i in range(4)]


def test_a_take_is_summed_up_by_batches_times_and_the_recording_it_became() -> None:
    acknowledged = report(ack_s=[0.030, 0.010, 0.2], resent=2, reconnects=1)
    assert _summary(acknowledged, BATCHES) == (
        "3 of 4 batches acknowledged, half within 30 ms, 99 % within 200 ms; 2 sent again after 1 "
        "reconnections.\nFinished as recording r1, sha256 0123456789ab…."
    )


def test_an_end_that_the_server_found_wrong_is_told() -> None:
    assert _summary(report(ack_s=[0.1], problem="finish_mismatch"), BATCHES).endswith(
        "\nThe server kept the take but found its end wrong (finish_mismatch)."
    )


def test_what_the_therapist_asks_for_is_said_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    _heard({"type": "ack", "command": "pause"})
    _heard({"type": "command", "command": "pause"})
    assert capsys.readouterr().out == "The therapist asks: pause.\n"


@pytest.mark.slow
def test_a_server_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        free = f"http://127.0.0.1:{s.getsockname()[1]}"
    assert main(["simulate", "--out", str(tmp_path), "--script", "swings_and_bows"]) == 0
    assert main(["replay", str(tmp_path / "recording.parquet"), "--to", free, "--code", "ABCDEF"]) == 1
    assert f"{free} cannot be reached (Connection refused); is the server running" in capsys.readouterr().err
