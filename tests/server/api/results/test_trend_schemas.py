"""Answers about visits compared: what the core and the report know of them is in them."""

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
    said = make_answer(schemas.Condition, walked)
    assert (said.protocol, said.belt_speed_mps, said.pace, said.aid) == ("treadmill", 1.25, "fast", "stick")
    assert said.words == walked.words
    assert "1.25" in said.words
