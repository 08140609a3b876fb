"""Orders of seven sensors: the one whose neighbours fit is found, and how far ahead it is."""

from __future__ import annotations

from itertools import combinations, pairwise
from math import log

import pytest

from sagittal.core.agreement.labels import PATH, SortedLabels, sort_by_joints
from sagittal.core.frames import Segment

EXCHANGED_LEG: tuple[Segment, ...] = (*PATH[:4], "foot_r", "shank_r", "thigh_r")
"""The right leg put on upside down."""


def misfits_of(path: tuple[Segment, ...]) -> dict[frozenset[Segment], float]:
    """Neighbours on this path fit to 0.1, all others to 1."""
    near = {frozenset(p) for p in pairwise(path)}
    return {frozenset(p): 0.1 if frozenset(p) in near else 1.0 for p in combinations(PATH, 2)}


def rates(**changed: float) -> dict[Segment, float]:
    return dict.fromkeys(PATH, 2.0) | {"pelvis": 1.0} | changed  # type: ignore[return-value]


def sort(path: tuple[Segment, ...], turning: dict[Segment, float] | None = None) -> SortedLabels:
    result = sort_by_joints(misfits_of(path), turning or rates(), 1.1)
    assert result is not None
    return result


def test_right_labels_are_the_best() -> None:
    order = sort(PATH)
    assert dict(order.stated_for) == {s: s for s in PATH}
    assert order.misfit == pytest.approx(0.1)
    assert order.stated == pytest.approx(0.1)
    assert order.gain == pytest.approx(0.0)
    assert order.next == pytest.approx(10 ** (-5 / 6)), "one of six neighbours no longer fits"


def test_a_leg_put_on_upside_down_is_sorted() -> None:
    order = sort(EXCHANGED_LEG)
    assert dict(order.stated_for) == dict(zip(PATH, EXCHANGED_LEG, strict=True))
    assert order.misfit == pytest.approx(0.1)
    assert order.stated == pytest.approx(10 ** (-5 / 6))
    assert order.gain == pytest.approx(log(10.0))
    assert order.exchange_legs() == dict(zip(PATH, reversed(EXCHANGED_LEG), strict=True))


def test_the_end_with_more_of_the_left_leg_stays_the_left_one() -> None:
    feet = ("foot_r", *PATH[1:6], "foot_l")
    assert dict(sort(feet).stated_for) == dict(zip(PATH, feet, strict=True))
    assert dict(sort(tuple(reversed(feet))).stated_for) == dict(zip(PATH, feet, strict=True))


def test_only_what_turns_least_can_be_the_pelvis() -> None:
    pelvis_is_thigh = (*PATH[:2], "pelvis", "thigh_l", *PATH[4:])
    order = sort(pelvis_is_thigh)
    assert order.stated_for["pelvis"] == "pelvis"
    assert order.misfit > 0.1
    assert sort(pelvis_is_thigh, rates(thigh_l=1.1)).stated_for["pelvis"] == "thigh_l"
    assert sort(pelvis_is_thigh, rates(thigh_l=1.2)).stated_for["pelvis"] == "pelvis"


def test_other_than_seven_sensors_are_not_sorted() -> None:
    six = dict.fromkeys(PATH[1:], 1.0)
    assert sort_by_joints(misfits_of(PATH), six, 1.1) is None
    lacking = misfits_of(PATH)
    del lacking[frozenset(("foot_l", "foot_r"))]
    assert sort_by_joints(lacking, rates(), 1.1) is None


def test_labels_are_clear_when_nothing_else_comes_near() -> None:
    result = SortedLabels({}, misfit=0.5, stated=1.0, next=0.6)
    assert result.is_clear(0.56, 1.1, 1.15)
    assert not result.is_clear(0.54, 1.1, 1.15), "the likely exchange fits nearly as well"
    assert not result.is_clear(0.56, 1.1, 1.25), "another order fits nearly as well"
