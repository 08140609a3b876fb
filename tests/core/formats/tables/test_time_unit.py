"""Units of columns of time."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import ManifestError
from sagittal.core.formats.tables.time_unit import check_tick, find_tick, read_unit


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("time_s", "s"),
        ("epoc (ms)", "ms"),
        ("Time [us]", "us"),
        ("t_ns", "ns"),
        ("X [s]", "s"),
        ("time", None),
    ],
)
def test_a_name_may_say_its_unit(column: str, unit: str | None) -> None:
    assert read_unit(column) == unit


@pytest.mark.parametrize(("step", "tick"), [(0.01, 1.0), (10.0, 1e-3), (1e4, 1e-6), (1e7, 1e-9)])
def test_steps_tell_the_unit(step: float, tick: float) -> None:
    assert find_tick("stamp", np.arange(500.0) * step, None, "a.csv") == tick


def test_ticks_of_another_length_need_a_rate_or_a_declaration() -> None:
    ticks = 1837005 + np.arange(500.0) * 100.0
    assert find_tick("stamp", ticks, 100.0, "a.csv") == pytest.approx(1e-4)
    with pytest.raises(ManifestError) as e:
        find_tick("stamp", ticks, None, "a.csv")
    assert e.value.code == "unit_missing"


def test_a_unit_that_cannot_be_is_refused_with_the_right_one() -> None:
    with pytest.raises(ManifestError, match="'ms' it is 100") as e:
        check_tick("t", np.arange(500.0) * 10.0, "s", "a.csv")
    assert e.value.code == "wrong_time_unit"
