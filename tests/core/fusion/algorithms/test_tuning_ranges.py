"""Printed gains lie within the tuning range of their type."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, get_type_hints

import pytest

from sagittal.core.fusion.algorithms import tuning_ranges
from sagittal.core.fusion.algorithms.gains import Gain
from sagittal.core.fusion.algorithms.listed import ALGORITHMS
from sagittal.core.fusion.algorithms.tuning_ranges import LEFT, SAMPLES, SHARE, TuningRange

RANGES = {name: x for name, x in vars(tuning_ranges).items() if isinstance(x, TuningRange)}


def numbers(value: Any) -> list[float]:
    """Finite levels of a gain, or the number itself; thresholds are not of its kind."""
    if not isinstance(value, Gain):
        return [value]
    return [
        x
        for f in fields(value)
        if f.name not in ("acc", "mag", "gyr") and isinstance(x := getattr(value, f.name), float)
    ]


def of_type(gains: type) -> list[tuple[str, TuningRange]]:
    hints = get_type_hints(gains, include_extras=True)
    notes = {name: getattr(hint, "__metadata__", ()) for name, hint in hints.items()}
    return [(name, x[0]) for name, x in notes.items() if x]


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_gains_as_printed_can_be_found_by_tuning(algorithm: Any) -> None:
    gains = algorithm.gains()
    tuned = of_type(type(gains))
    assert tuned
    for name, limits in tuned:
        for number in numbers(getattr(gains, name)):
            sought = 1.0 - number if limits.left else number
            # what is left out is as good as the least
            assert limits.low <= sought <= limits.high or number == 0.0, name


def test_ranges_can_be_divided_evenly_over_their_logarithm() -> None:
    assert len(RANGES) == 11
    for name, limits in RANGES.items():
        assert 0.0 < limits.low < limits.high, name


def test_shares_end_at_all_and_only_what_is_left_is_sought_from_one_down() -> None:
    assert SHARE.high == LEFT.high == 1.0
    assert SAMPLES.low == 1.0
    assert [name for name, x in RANGES.items() if x.left] == ["LEFT"]


def test_every_range_is_of_some_gain() -> None:
    used = {id(limits) for algorithm in ALGORITHMS for _, limits in of_type(algorithm.gains)}
    assert {name for name, x in RANGES.items() if id(x) in used} == set(RANGES)
