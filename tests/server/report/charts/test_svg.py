"""What all charts are drawn with."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sagittal.server.report.charts.svg import TICKS, find_round_ticks

ENDS = st.floats(-1e3, 1e3)
SPANS = st.floats(1e-2, 1e4)


@given(ENDS, SPANS)
@example(44.1, 17.3)
def test_ticks_are_multiples_of_one_two_or_five_times_a_power_of_ten(low: float, span: float) -> None:
    ticks, digits = find_round_ticks(low, low + span)
    assert 1 <= len(ticks) <= TICKS + 1
    assert [round(t, digits) for t in ticks] == pytest.approx(ticks)
    assert all(low - 1e-6 * span <= t <= low + 1.000001 * span for t in ticks)
    if len(ticks) > 1:
        step = ticks[1] - ticks[0]
        assert f"{step:.3e}"[:4] in ("1.00", "2.00", "5.00")
        assert all(abs(t / step - round(t / step)) < 1e-3 for t in ticks)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (44.1, 61.4, [45.0, 50.0, 55.0, 60.0]),
        (0.0, 0.6, [0.0, 0.2, 0.4, 0.6]),
        (-0.3, 0.3, [-0.2, 0.0, 0.2]),
        (995.0, 1005.0, [996.0, 998.0, 1000.0, 1002.0, 1004.0]),
    ],
)
def test_an_end_that_is_a_multiple_gets_its_tick(low: float, high: float, expected: list[float]) -> None:
    assert find_round_ticks(low, high)[0] == pytest.approx(expected)
