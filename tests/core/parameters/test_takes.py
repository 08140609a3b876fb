"""The mean of several takes, against takes drawn with known spread."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.takes import join_takes


def take(values: list[float] | np.ndarray, **changed: object) -> Parameter:
    x = np.asarray(values, dtype=float)
    sd = float(x.std(ddof=1))
    half = 1.96 * sd / len(x) ** 0.5
    mean = float(x.mean())
    found = Parameter("step_length_m", "left", len(x), mean, sd, "m", ci_low=mean - half, ci_high=mean + half)
    return replace(found, **changed)  # type: ignore[arg-type]


def test_one_take_is_itself_and_takes_without_a_value_do_not_count() -> None:
    one = take([0.5, 0.6, 0.7])
    none = Parameter("step_length_m", "left", 0, None, None, "m", reason="no_strides")
    assert join_takes([one]) is one
    assert join_takes([none, one]) is one
    assert join_takes([none]).reason == "no_strides"


def test_each_take_counts_once_however_many_strides_it_has() -> None:
    few, many = take([0.4, 0.42]), take([0.6] * 20 + [0.62] * 20)
    joined = join_takes([few, many])
    assert joined.mean == pytest.approx((0.41 + 0.61) / 2)
    assert joined.n == 42
    assert joined.sd is None


def test_the_interval_holds_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(400):
        joined = join_takes([take(rng.normal(0.6, 0.03, n)) for n in (20, 30, 40)])
        assert joined.ci_low is not None
        assert joined.ci_high is not None
        held += joined.ci_low <= 0.6 <= joined.ci_high
    assert 0.92 < held / 400 < 0.98


def test_what_takes_measure_anew_averages_out_and_what_they_share_stays() -> None:
    known = take([0.5, 0.6], u_own=0.02, u_common=0.01)
    joined = join_takes([known] * 4)
    assert joined.u_own == pytest.approx(0.01)
    assert joined.u_common == 0.01
    assert join_takes([known, take([0.5, 0.6])]).u_own is None


def test_a_shared_error_is_that_of_all_takes_and_not_of_the_first() -> None:
    """Errors that all takes share add up: the mean of 0.01 and 0.05 times the same error is 0.03 times it."""
    sure, vague = (take([0.5, 0.6], u_own=0.0, u_common=x) for x in (0.01, 0.05))
    for takes in ([sure, vague], [vague, sure]):
        assert join_takes(takes).u_common == pytest.approx(0.03)
    assert join_takes([sure, take([0.5, 0.6])]).u_common is None


def test_other_parameters_and_sides_are_not_joined() -> None:
    with pytest.raises(ParameterError, match="one parameter"):
        join_takes([take([0.5, 0.6]), take([0.5, 0.6], side="right")])
    with pytest.raises(ParameterError, match="No take"):
        join_takes([])
