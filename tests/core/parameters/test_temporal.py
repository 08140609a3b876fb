"""Temporal parameters from hand-made strides whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.events.result import Stride, Strides
from sagittal.core.parameters import per_stride, stride_values, summarise_times
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.catalogue.entry import PHASES, SUPPORT, TIMING
from sagittal.core.parameters.result import Parameter

# start, leaves 0.6 s later, other foot leaves at 0.1 and lands at 0.5 s
RIGHT = Stride("right", 2.0, 2.65, 3.0, 2.1, 2.52)


def by_name(parameters: tuple[Parameter, ...], side: str | None = "right") -> dict[str, Parameter]:
    return {p.name: p for p in parameters if p.side == side}


def test_one_stride_by_hand() -> None:
    assert stride_values(RIGHT) == pytest.approx(
        {
            "stride_time_s": 1.0,
            "step_time_s": 0.48,
            "stance_time_s": 0.65,
            "stance_pct": 65.0,
            "swing_time_s": 0.35,
            "swing_pct": 35.0,
            "initial_double_support_s": 0.10,
            "initial_double_support_pct": 10.0,
            "terminal_double_support_s": 0.13,
            "terminal_double_support_pct": 13.0,
            "double_support_s": 0.23,
            "double_support_pct": 23.0,
            "single_support_s": 0.42,
            "single_support_pct": 42.0,
        }
    )


def test_mean_and_spread_over_the_counted_strides_only() -> None:
    strides = Strides(
        (
            Stride("right", 0.0, 0.6, 1.0, 0.1, 0.5),
            Stride("right", 1.0, 1.7, 2.2, 1.1, 1.6),
            Stride("right", 2.2, 3.0, 4.4, 2.3, 3.3, excluded_reason="turn"),
            Stride("left", 0.5, 1.1, 1.6, 0.6, 1.0),
        )
    )
    found = summarise_times(strides)
    stride_time = by_name(found)["stride_time_s"]
    assert (stride_time.n, stride_time.unit, stride_time.reason) == (2, "s", None)
    assert stride_time.mean == pytest.approx(1.1)
    assert stride_time.sd == pytest.approx(np.std([1.0, 1.2], ddof=1))
    one = by_name(found, "left")["stride_time_s"]
    assert (one.n, one.sd) == (1, None)
    assert one.mean == pytest.approx(1.1)
    # steps: right 0.5 and 0.6 s, left 0.6 s
    cadence = by_name(found, None)["cadence_spm"]
    assert (cadence.n, cadence.unit) == (3, "steps/min")
    assert cadence.mean == pytest.approx(60.0 / np.mean([0.5, 0.6, 0.6]))
    assert cadence.sd == pytest.approx(np.std([120.0, 100.0, 100.0], ddof=1), rel=0.15)


def test_every_name_stands_on_both_sides_even_with_nothing_to_say() -> None:
    nothing = summarise_times(Strides(()))
    assert len(nothing) == 2 * 14 + 1
    assert {p.reason for p in nothing} == {"no_strides"}
    assert all(p.mean is None and p.sd is None and p.n == 0 for p in nothing)


def test_one_foot_alone_has_its_own_times_and_says_what_is_missing() -> None:
    found = summarise_times(Strides((Stride("right", 0.0, 0.6, 1.0), Stride("right", 1.0, 1.6, 2.0))))
    right = by_name(found)
    assert right["stance_pct"].mean == pytest.approx(60.0)
    assert {right[n].reason for n in ("step_time_s", "double_support_pct", "single_support_s")} == {
        "opposite_foot_missing"
    }
    assert by_name(found, None)["cadence_spm"].reason == "opposite_foot_missing"
    assert {p.reason for p in by_name(found, "left").values()} == {"no_strides"}


def test_missing_terminal_contact_and_flight_have_their_own_reasons() -> None:
    no_tc = by_name(summarise_times(Strides((Stride("right", 0.0, None, 1.0, 0.1, 0.5),))))
    assert no_tc["stance_pct"].reason == "no_terminal_contact"
    assert no_tc["double_support_s"].reason == "no_terminal_contact"
    assert no_tc["single_support_s"].mean == pytest.approx(0.4)
    running = by_name(summarise_times(Strides((Stride("right", 0.0, 0.25, 0.7, None, 0.35),))))
    assert running["terminal_double_support_s"].reason == "no_double_support"
    assert running["double_support_pct"].reason == "no_double_support"
    assert running["step_time_s"].mean == pytest.approx(0.35)


def test_the_table_has_a_row_for_every_stride_counted_or_not() -> None:
    strides = Strides((RIGHT, Stride("left", 2.5, None, 9.0, excluded_reason="implausible_time")))
    table = per_stride(strides)
    of_strides = {
        n for n, e in CATALOGUE.items() if e.of == "stride" and e.group in {TIMING, PHASES, SUPPORT}
    }
    assert set(table) == of_strides
    assert table["stride_time_s"] == pytest.approx((1.0, 6.5))
    assert table["stance_pct"][1] is None


@given(st.lists(st.floats(0.001, 1.0), min_size=5, max_size=5), st.floats(0.0, 1000.0))
def test_stance_and_swing_are_the_stride_and_supports_are_the_stance(
    parts: list[float], start: float
) -> None:
    opposite_tc, opposite_ic, tc, end = start + np.cumsum(parts)[:4]
    v = stride_values(Stride("left", start, float(tc), float(end), float(opposite_tc), float(opposite_ic)))
    assert all(x is not None for x in v.values())
    assert v["stance_pct"] + v["swing_pct"] == pytest.approx(100.0)  # type: ignore[operator]
    assert v["stance_time_s"] + v["swing_time_s"] == pytest.approx(v["stride_time_s"])  # type: ignore[operator]
    supports = v["double_support_pct"] + v["single_support_pct"]  # type: ignore[operator]
    assert supports == pytest.approx(v["stance_pct"])
    both = v["initial_double_support_s"] + v["terminal_double_support_s"]  # type: ignore[operator]
    assert both == pytest.approx(v["double_support_s"])
