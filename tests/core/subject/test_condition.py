"""Only walks under the same condition are compared."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import pytest

from sagittal.core.frames import PROTOCOLS
from sagittal.core.subject.condition import (
    CHOICES,
    PROTOCOL_WORDS,
    USUAL,
    Footwear,
    Orthosis,
    WalkingAid,
    WalkingCondition,
    WalkingPace,
    compare_conditions,
    is_alike,
    is_comparable,
)

TYPES: dict[str, Any] = {
    "pace": WalkingPace,
    "aid": WalkingAid,
    "orthosis": Orthosis,
    "shoes": Footwear,
}

OTHERWISE: list[dict[str, Any]] = [
    {"pace": "fast"},
    {"pace": None},
    {"aid": "rollator"},
    {"orthosis": "ankle_foot"},
    {"shoes": "barefoot"},
    {"protocol": "treadmill"},
]


def test_every_value_has_words_and_no_other() -> None:
    assert {name: tuple(words) for name, words in CHOICES.items()} == {
        n: get_args(t) for n, t in TYPES.items()
    }
    assert tuple(PROTOCOL_WORDS) == PROTOCOLS


@pytest.mark.parametrize("changed", OTHERWISE)
def test_a_walk_in_another_condition_is_not_compared(changed: dict[str, Any]) -> None:
    other_variant = replace(USUAL, **changed)
    assert not is_comparable(USUAL, other_variant)
    assert not is_comparable(other_variant, USUAL)
    assert is_comparable(other_variant, other_variant)
    assert len(compare_conditions(USUAL, other_variant)) == 1


def test_a_walk_with_feedback_is_compared_with_nothing_though_walked_alike() -> None:
    variant = replace(USUAL, feedback=True)
    assert is_alike(USUAL, variant)
    assert not is_comparable(USUAL, variant)
    assert not is_comparable(variant, variant)
    assert compare_conditions(USUAL, variant) == ("without feedback, then with",)


def test_what_nobody_stated_is_like_nothing_but_itself() -> None:
    silent = WalkingCondition()
    assert is_comparable(silent, WalkingCondition())
    assert not is_comparable(silent, USUAL)
    assert silent.unstated == tuple(CHOICES)
    assert silent.words == "condition not stated"


@pytest.mark.parametrize(
    ("before", "after", "alike"),
    [(0.83, 0.8333, True), (0.83, 0.861, False), (0.83, None, False), (None, None, True)],
)
def test_belts_of_another_speed_are_another_condition(
    before: float | None, after: float | None, alike: bool
) -> None:
    # 3.0 km/h typed with two and four decimals; one step of a treadmill, 0.1 km/h, faster
    a, b = (replace(USUAL, protocol="treadmill", belt_speed_mps=v) for v in (before, after))
    assert is_comparable(a, b) is alike


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        (USUAL, "comfortable pace, no aid, shoes"),
        (replace(USUAL, pace="fast", orthosis="ankle_foot"), "fast, no aid, ankle-foot orthosis, shoes"),
        (replace(USUAL, aid=None, feedback=True), "comfortable pace, aid not stated, shoes, with feedback"),
        (WalkingCondition(feedback=True), "condition not stated, with feedback"),
        (
            replace(USUAL, protocol="treadmill", belt_speed_mps=0.83),
            "treadmill at 0.83\u202fm/s, comfortable pace, no aid, shoes",
        ),
    ],
)
def test_a_condition_is_said_in_words(condition: WalkingCondition, words: str) -> None:
    assert condition.words == words


def test_differences_name_both_conditions_in_their_order() -> None:
    fast = replace(USUAL, pace="fast", aid="stick")
    assert compare_conditions(USUAL, fast) == ("comfortable pace, then fast", "no aid, then stick")


def test_only_unaided_walks_serve_others_as_reference() -> None:
    assert USUAL.is_unaided
    assert WalkingCondition().is_unaided
    for changed in ({"aid": "stick"}, {"orthosis": "knee"}, {"feedback": True}):
        assert not replace(USUAL, **changed).is_unaided
