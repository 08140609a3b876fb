"""Figures that say the same by their definition count as one change."""

from __future__ import annotations

import pytest

from sagittal.core.change import Change, name_fact, sort_changes
from sagittal.core.change.facts import SAME_AS
from sagittal.core.change.verdict import Verdict
from sagittal.core.frames import Side
from sagittal.core.parameters.catalogue import CATALOGUE


def change(name: str, side: Side | None, key: float, verdict: Verdict | None = "real_change") -> Change:
    return Change(
        name, side, "", 50.0, 50.0 + key, key, verdict, 4.2, "a table", None, None, None, None, None, None
    )


@pytest.mark.parametrize(
    "same",
    [
        (("stance_pct", "right"), ("swing_pct", "right"), ("single_support_pct", "left")),
        (("double_support_pct", "left"), ("double_support_pct", "right")),
        (("initial_double_support_pct", "left"), ("terminal_double_support_pct", "right")),
        (("swing_time_s", "left"), ("single_support_s", "right")),
        (("cadence_spm", None), ("stride_time_s", "left"), ("stride_time_s", "right")),
    ],
)
def test_what_one_definition_makes_equal_is_one_fact(same: tuple[tuple[str, Side | None], ...]) -> None:
    changes = sort_changes([change(name, side, 6.2) for name, side in same])
    assert len(changes.real) == 1
    assert changes.real[0].change.name == same[0][0]
    assert [(c.name, c.side) for c in changes.real[0].same] == list(same[1:])


def test_legs_and_figures_that_differ_are_facts_of_their_own() -> None:
    changes = sort_changes([
        change("stance_pct", "left", 6.2),
        change("stance_pct", "right", 6.2),
        change("step_length_m", "left", 0.1),
    ])  # fmt: skip
    assert len(changes.real) == 3


def test_a_fact_is_real_where_any_figure_of_it_is() -> None:
    changes = sort_changes([
        change("stance_pct", "left", 4.1, "within_measurement_error"),
        change("swing_pct", "left", -4.3),
        change("step_length_m", "left", 0.01, "within_measurement_error"),
        change("circumduction_m", "left", 0.01, None),
    ])  # fmt: skip
    assert [f.change.name for f in changes.real] == ["swing_pct"]
    assert (changes.within, changes.unjudged) == (1, 1)


def test_only_figures_of_the_catalogue_are_the_same() -> None:
    for name, (to, source) in SAME_AS.items():
        assert {name, to} <= set(CATALOGUE)
        assert name_fact(name, "left") == name_fact(
            to, {"own": "left", "other": "right", "take": None}[source]
        )
