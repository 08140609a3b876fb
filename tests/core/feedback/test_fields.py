"""Field-by-field reading of a record: defaults, limits, refusals naming the expected value."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.feedback.fields import RecordFields

FULL = {
    "number": 2, "none": None, "whole": 3.0, "flag": True, "choice": "b", "choices": ["a", "b"],
    "percents": [100, 0], "text": "words", "part": {"inner": 1},
}  # fmt: skip


def read_all(f: RecordFields) -> list[object]:
    """Every reader once."""
    return [
        f.number("number", 1.5, 0.0, 2.0),
        f.number_or_none("none", 1.0),
        f.whole("whole", 7, 0, 7),
        f.whole_or_none("none", 5, 0, 9),
        f.flag("flag", False),
        f.choice("choice", ("a", "b"), "a"),
        f.choices("choices", ("a", "b"), ("b",)),
        f.percents("percents", (50,)),
        f.text("text", "default"),
        f.part("part").number("inner", 4.0, 0.0, 9.0),
    ]


def test_what_is_there_is_read() -> None:
    result = read_all(RecordFields("record", FULL))
    assert result == [2.0, None, 3, None, True, "b", ("a", "b"), (100, 0), "words", 1.0]
    assert [type(x) for x in result[:3]] == [float, type(None), int]


def test_what_is_left_out_has_its_default() -> None:
    assert read_all(RecordFields("record", {})) == [
        1.5, 1.0, 7, 5, False, "a", ("b",), (50,), "default", 4.0,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("read", "value", "said"),
    [
        (lambda f: f.number("x", 0.0, 0.0, 2.0), 2.1, "2.1. Expected a number from 0 to 2."),
        (lambda f: f.number("x", 0.0, 0.0, 2.0), -0.1, "-0.1. Expected a number from 0 to 2."),
        (lambda f: f.number("x", 0.0, 0.0, 2.0), None, "None. Expected a number."),
        (lambda f: f.number("x", 0.0, 0.0, 2.0), True, "True. Expected a number."),
        (lambda f: f.number_or_none("x", 0.0), float("inf"), "inf. Expected a number."),
        (lambda f: f.number_or_none("x", 0.0), "1", "'1'. Expected a number."),
        (lambda f: f.whole("x", 0, 1, 3), 2.5, "2.5. Expected a whole number from 1 to 3."),
        (lambda f: f.whole("x", 0, 1, 3), 4, "4. Expected a whole number from 1 to 3."),
        (lambda f: f.whole("x", 0, 1, 3), 0, "0. Expected a whole number from 1 to 3."),
        (lambda f: f.whole_or_none("x", 0, 0, 3), False, "False. Expected a whole number from 0 to 3."),
        (lambda f: f.flag("x", False), 1, "1. Expected true or false."),
        (lambda f: f.choice("x", ("a", None)), "c", "'c'. Expected one of a, null."),
        (lambda f: f.choice("x", (1, 2)), True, "True. Expected one of 1, 2."),
        (lambda f: f.choices("x", ("a", "b"), ()), [], "[]. Expected a list of at least one of a, b."),
        (lambda f: f.choices("x", ("a", "b"), ()), ["a", "c"], "['a', 'c']. Expected a list of at least"),
        (lambda f: f.choices("x", ("a", "b"), ()), "a", "'a'. Expected a list of at least one of a, b."),
        (lambda f: f.percents("x", ()), [101], "[101]. Expected a list of 1 to 20 whole percents"),
        (lambda f: f.percents("x", ()), [-1], "[-1]. Expected a list"),
        (lambda f: f.percents("x", ()), [True], "[True]. Expected a list"),
        (lambda f: f.percents("x", ()), [], "[]. Expected a list"),
        (lambda f: f.percents("x", ()), [1] * 21, "Expected a list of 1 to 20"),
        (lambda f: f.text("x", None), 5, "5. Expected text of at most 500 characters."),
        (lambda f: f.text("x", None), "a" * 501, "Expected text of at most 500 characters."),
    ],
)
def test_what_is_not_understood_is_refused_with_what_was_expected(
    read: Callable[[RecordFields], Any], value: object, said: str
) -> None:
    with pytest.raises(ParameterError) as refused:
        read(RecordFields("record", {"x": value}))
    assert refused.value.code == "bad_prescription"
    assert refused.value.message.startswith("record.x is ")
    assert said in refused.value.message


def test_the_limits_themselves_are_allowed() -> None:
    f = RecordFields("record", {"low": 0, "high": 2.0, "long": "a" * 500, "many": [1] * 20})
    assert (f.number("low", 1.0, 0.0, 2.0), f.number("high", 1.0, 0.0, 2.0)) == (0.0, 2.0)
    assert (f.whole("low", 1, 0, 2), f.whole("high", 1, 0, 2)) == (0, 2)
    assert len(f.text("long", None) or "") == 500
    assert len(f.percents("many", ())) == 20


def test_a_choice_without_a_default_must_be_made() -> None:
    with pytest.raises(ParameterError, match=r"record\.x is None\. Expected one of a, b\."):
        RecordFields("record", {}).choice("x", ("a", "b"))


def test_an_object_is_asked_for_and_named_by_its_way() -> None:
    with pytest.raises(ParameterError, match=r"record is \[\]\. Expected an object with named fields\."):
        RecordFields("record", [])
    inner = RecordFields("record", {"a": {"b": {"x": "?"}}}).part("a").part("b")
    with pytest.raises(ParameterError, match=r"^record\.a\.b\.x is '\?'"):
        inner.flag("x", False)
    with pytest.raises(ParameterError, match=r"^target\.x is"):
        RecordFields("prescription", {"target": {"x": 1}}).part("target").flag("x", False)


def test_fields_that_nobody_asked_for_are_refused() -> None:
    f = RecordFields("record", {"mean": 1.0, "zz": 1, "meen": 2.0})
    f.number("mean", 0.0, 0.0, 2.0)
    f.flag("absent", False)
    with pytest.raises(
        ParameterError, match=r"record has meen, zz\. Expected only absent, mean\."
    ) as refused:
        f.refuse_unknown()
    assert refused.value.code == "bad_prescription"
    f.number("zz", 0.0, 0.0, 2.0)
    f.number("meen", 0.0, 0.0, 2.0)
    f.refuse_unknown()
