"""What requests about live takes may hold."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest
from pydantic import ValidationError

from sagittal.server.api.live_takes.live_schemas import FilmBeginning, LiveCommand, LiveSensor, PairingCode
from sagittal.server.live.sensors import sensor_rows
from tests.helpers.live_takes import HELLO


@pytest.mark.parametrize(
    "body",
    [
        {"command": "start"},
        {"command": "feedback", "value": True},
        {"command": "level", "value": -2},
        {"command": "mark", "value": "x" * 200, "t_s": 0.0},
        {"command": "test", "value": {"began_s": 1.0, "ended_s": 9.5}},
        {"command": "ghost", "value": None},
    ],
)
def test_a_command_keeps_its_value_as_it_came(body: dict[str, Any]) -> None:
    sent = LiveCommand.model_validate(body)
    assert (sent.command, sent.value, sent.t_s) == (body["command"], body.get("value"), body.get("t_s"))
    assert type(sent.value) is type(body.get("value"))


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"command": "jump"},
        {"command": "mark", "value": "x" * 201},
        {"command": "mark", "t_s": -0.001},
        {"command": "test", "value": {"began_s": "soon"}},
        {"command": "start", "force": True},
    ],
)
def test_another_command_is_refused(body: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        LiveCommand.model_validate(body)


def test_a_code_and_the_beginning_of_a_film_have_limits() -> None:
    assert PairingCode(code="abc-def").code == "abc-def"
    assert FilmBeginning(consent=False, began_us=(1 << 53) - 1).began_us == (1 << 53) - 1
    for kind, body in (
        (PairingCode, {"code": ""}),
        (PairingCode, {"code": "x" * 41}),
        (FilmBeginning, {"consent": True, "began_us": -1}),
        (FilmBeginning, {"consent": True, "began_us": 1 << 53}),  # not exact in a browser
        (FilmBeginning, {"began_us": 1}),
    ):
        with pytest.raises(ValidationError):
            kind.model_validate(body)


def test_a_sensor_is_told_as_the_recorder_knows_it() -> None:
    (row, *_) = sensor_rows(HELLO, (), {}, silent=False)
    assert set(row) == {f.name for f in fields(LiveSensor)}
