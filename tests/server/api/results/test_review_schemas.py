"""What an edit over the wire may hold."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest
from pydantic import ValidationError

from sagittal.server.api.results.review_schemas import EditAnswer, EditNew

MOVE = {"kind": "move_event", "side": "left", "event": "ic", "time_s": 1.5, "to_s": 1.52}


def test_an_edit_keeps_what_was_sent() -> None:
    assert EditNew.model_validate(MOVE).values() == MOVE
    out = {"kind": "exclude_stride", "side": "right", "time_s": 0, "reason": "Stumbled"}
    assert EditNew.model_validate(out).values() == out


@pytest.mark.parametrize(
    ("changed", "good"),
    [
        ({"time_s": -0.001}, False),
        ({"time_s": 1e6}, True),
        ({"time_s": 1e6 + 1}, False),
        ({"time_s": float("nan")}, False),
        ({"to_s": -5.0}, True),  # refused by the review, in its own words
        ({"to_s": -1e6 - 1}, False),
        ({"to_s": float("inf")}, False),
        ({"event": "heel"}, False),
        ({"side": None}, False),
        ({"kind": "undo"}, False),
        ({"reason": ""}, False),
        ({"reason": "two\nlines"}, False),
        ({"strides": 3}, False),
    ],
)
def test_times_are_finite_and_choices_known(changed: dict[str, Any], good: bool) -> None:
    if good:
        assert EditNew.model_validate(MOVE | changed).values() == MOVE | changed
        return
    with pytest.raises(ValidationError):
        EditNew.model_validate(MOVE | changed)


def test_an_edit_is_answered_with_all_that_was_asked() -> None:
    assert set(EditNew.model_fields) <= {f.name for f in fields(EditAnswer)}
