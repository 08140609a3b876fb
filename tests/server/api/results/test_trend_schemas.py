"""Schemas of trends contain all fields of core and report."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from sagittal.core.change import Change
from sagittal.core.subject.condition import USUAL, WalkingCondition
from sagittal.server.api.results import trend_schemas as schemas
from sagittal.server.api.schemas import make_answer
from sagittal.server.report.history.trends import TrendSeries


def names(kind: type[Any]) -> set[str]:
    return {f.name for f in fields(kind)}


@pytest.mark.parametrize(
    ("answer", "source", "more"),
    [
        (schemas.Condition, WalkingCondition, {"words"}),
        (schemas.ChangeInWords, Change, {"words"}),
        (schemas.TrendLine, TrendSeries, {"words"}),
    ],
)
def test_an_answer_has_every_member_of_its_source(
    answer: type[Any], source: type[Any], more: set[str]
) -> None:
    assert names(answer) == names(source) | more


def test_a_condition_is_answered_as_it_was_walked_and_in_words() -> None:
    walked = replace(
        USUAL, pace="fast", aid="stick", feedback=True, protocol="treadmill", belt_speed_mps=1.25
    )
    message = make_answer(schemas.Condition, walked)
    assert (message.protocol, message.belt_speed_mps, message.pace, message.aid) == (
        "treadmill",
        1.25,
        "fast",
        "stick",
    )
    assert message.words == walked.words
    assert "1.25" in message.words
