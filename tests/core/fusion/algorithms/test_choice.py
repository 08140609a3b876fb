"""Filters requested by name: listed, tunable, and refused ones."""

from __future__ import annotations

import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.fusion.algorithms.choice import LABELS, OWN, require_filters, require_tunable
from sagittal.core.fusion.algorithms.listed import ALGORITHMS

OURS, THEIRS = OWN[0].name, ALGORITHMS[0].name


def test_every_filter_has_a_label_of_its_own() -> None:
    assert list(LABELS) == [*(a.name for a in ALGORITHMS), *(o.name for o in OWN)]
    assert len(set(LABELS.values())) == len(LABELS)
    assert [o.both_ways for o in OWN] == [False, True]
    assert LABELS[THEIRS] == ALGORITHMS[0].shown


@pytest.mark.parametrize(
    ("names", "code", "said"),
    [([], "no_filter", "at least one"), ([THEIRS, "kalman", "other"], "no_such_algorithm", "'kalman'")],
)
def test_only_a_choice_of_listed_ones_is_taken(names: list[str], code: str, said: str) -> None:
    require_filters([OURS, THEIRS])
    require_filters(list(LABELS))
    with pytest.raises(ParameterError, match=said) as refused:
        require_filters(names)
    assert refused.value.code == code


def test_only_published_filters_have_gains_to_fit() -> None:
    for algorithm in ALGORITHMS:
        require_tunable(algorithm.name)
    for own in OWN:
        with pytest.raises(ParameterError, match=f"'{own.name}' calibrates itself") as refused:
            require_tunable(own.name)
        assert refused.value.code == "nothing_to_tune"
    with pytest.raises(ParameterError, match="no filter 'kalman' to tune") as unknown:
        require_tunable("kalman")
    assert unknown.value.code == "no_such_algorithm"
