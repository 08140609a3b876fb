"""A message is its English sentence and keeps what it was made from."""

from __future__ import annotations

import copy
import datetime as dt
import json
import pickle
from enum import StrEnum

import numpy as np
import pytest

from sagittal.core.errors import Notice, SignalError
from sagittal.core.message import Message, describe_message, join_messages, read_message
from sagittal.core.user_text import UserText


class Colour(StrEnum):
    RED = "red"


def make_message() -> Message:
    return Message(
        "Sensor {device} on {segment} is {ms:.1f} ms late since {day}: {cause}",
        device="Left 2.0",
        segment="foot_l",
        ms=np.float64(12.345),
        day=dt.date(2026, 11, 18),
        cause=Message("{n} batches were lost.", n=np.int64(3)),
    )


def test_a_message_is_its_sentence() -> None:
    message = make_message()
    assert message == "Sensor Left 2.0 on foot_l is 12.3 ms late since 2026-11-18: 3 batches were lost."
    assert message.identifier == "Sensor {device} on {segment} is {ms} ms late since {day}: {cause}"


def test_values_have_plain_types() -> None:
    values = make_message().values
    assert (type(values["ms"]), type(values["segment"])) == (float, str)
    assert values["ms"] == 12.345
    assert type(Message("{colour}", colour=Colour.RED).values["colour"]) is str
    assert Message("{x}", x=np.float32(0.1)).values["x"] == 0.1
    assert Message("{x}", x=(1, 2)).values["x"] == "(1, 2)"
    assert Message("{x}", x=None).values["x"] is None


def test_what_is_quoted_or_an_identifier_is_user_text() -> None:
    message = Message("“{title}” of {file} as '{kind}' for {side}", title="a", file="b", kind="c", side="d")
    assert [name for name, value in message.values.items() if isinstance(value, UserText)] == [
        "title",
        "file",
    ]
    numbered = Message("The code '{code}' is taken.", code=2.5)
    assert isinstance(numbered.values["code"], UserText)


@pytest.mark.parametrize(
    "value", [0.0, -2, True, None, float("inf"), "left", UserText("left"), dt.date(2026, 1, 2)]
)
def test_values_survive_json(value: object) -> None:
    stored = json.dumps(describe_message(Message("a {x}", x=value)), allow_nan=False)
    read = read_message(json.loads(stored))
    assert isinstance(read, Message)
    assert (read.values["x"], type(read.values["x"])) == (value, type(value))


def test_a_stored_message_is_read_back() -> None:
    message = make_message()
    read = read_message(json.loads(json.dumps(describe_message(message))))
    assert isinstance(read, Message)
    assert (read, read.template, read.values) == (message, message.template, message.values)
    assert isinstance(read.values["cause"], Message)


def test_a_stored_sentence_stays_a_sentence() -> None:
    read = read_message({"message": "Sensor 3 was lost."})
    assert (read, type(read)) == ("Sensor 3 was lost.", str)


def test_a_message_survives_a_copy_and_a_pipe() -> None:
    message = make_message()
    for other in (copy.deepcopy(message), pickle.loads(pickle.dumps(message))):  # noqa: S301 - ours
        assert (other, other.template, other.values) == (message, message.template, message.values)


def test_an_error_survives_a_pipe_with_its_message() -> None:
    error = pickle.loads(pickle.dumps(SignalError("late", make_message())))  # noqa: S301 - ours
    assert isinstance(error.message, Message)
    assert str(error) == make_message()


def test_sentences_are_joined_to_one_message() -> None:
    joined = join_messages("It was lost.", Message("{n} strides are left out.", n=3), between=" | ")
    assert joined == "It was lost. | 3 strides are left out."
    assert joined.identifier == "{part1} | {part2}"


def test_words_are_changed_in_values_and_user_text_is_not() -> None:
    changed = Message("{a} of “{b}”: {c}", a="x", b="x", c=Message("{d} x", d="x")).map_words(
        lambda text: text.replace("x", "y")
    )
    assert [changed.values[name] for name in "abc"] == ["y", "x", "y y"]
    assert changed.values["c"].values["d"] == "y"  # type: ignore[union-attr]


def test_a_notice_writes_its_template_and_reads_it_back() -> None:
    notice = Notice("late", make_message(), "foot_l", 1.5, "info")
    stored = json.loads(json.dumps(notice.to_json()))
    assert stored["message"] == make_message()
    assert stored["template"] == make_message().template
    read = Notice.from_json(stored)
    assert read == notice
    assert isinstance(read.message, Message)
    old = Notice.from_json({"code": "late", "message": "It is late.", "sensor": None, "t_s": None})
    assert (old.message, old.severity) == ("It is late.", "warning")
