"""JSON from outside is read by one rule, whoever sent it."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.formats.json_tree import MOST_DEPTH, read_json

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


@pytest.mark.slow
@given(VALUES)
def test_what_json_can_say_is_read_as_it_is(value: object) -> None:
    text = json.dumps(value, ensure_ascii=False)
    assert read_json(text) == value
    assert read_json(text.encode("utf-8-sig")) == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("NaN", "NaN is not a number"),
        ('{"a": [-Infinity]}', "-Infinity is not a number"),
        ('{"a": [1e400]}', "too large"),
        ('{"a": {"b": 1, "b": 1}}', "the key 'b' is given twice"),
        ("1" + 400 * "0", "too large"),
        ("9" * 5000, "too large"),
        ('["\\ud800"]', "not valid Unicode"),
        ('{"\\ud800": 1}', "not valid Unicode"),
        ('{"\\ud800": 1, "\\ud800": 2}', r"the key '\\ud800' is given twice"),
        ('{"' + 99 * "k" + '": 1, "' + 99 * "k" + '": 2}', "the key 'k{40}…' is given twice"),
        (b'"\xff"', "not valid Unicode"),
        ("", "Expecting value"),
        ("[1] 2", "Extra data"),
        ("[" * 100_000, f"more than {MOST_DEPTH} levels"),
        ("[" * (MOST_DEPTH + 1) + "]" * (MOST_DEPTH + 1), f"more than {MOST_DEPTH} levels"),
    ],
)
def test_what_is_no_strict_json_is_refused_with_its_reason(text: str | bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read_json(text)


def test_as_many_levels_as_are_allowed_are_read() -> None:
    text = "[" * MOST_DEPTH + "]" * MOST_DEPTH
    assert json.dumps(read_json(text)) == text


def test_a_text_longer_than_its_limit_is_not_read() -> None:
    assert read_json(b"[1]", 3) == [1]
    with pytest.raises(ValueError, match="it has 3 bytes, at most 2"):
        read_json(b"[1]", 2)
