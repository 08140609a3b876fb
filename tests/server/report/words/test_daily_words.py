"""What daily life is called: every kind has its words, every moment its day and time."""

from __future__ import annotations

import pytest

from sagittal.core.activity.result import KINDS, TRANSITIONS
from sagittal.server.report.words.daily_words import (
    DAY_S,
    HOUR_S,
    KIND_LABELS,
    KIND_WORDS,
    TOTALS,
    TRANSITION_LABELS,
    clock_label,
    find_day_label,
    find_midnight,
    format_hours,
)
from tests.server import daily


def test_every_kind_and_transition_has_its_words_and_a_column() -> None:
    assert set(KIND_LABELS) == set(KIND_WORDS) == set(KINDS)
    assert sorted(kind for kinds in TOTALS.values() for kind in kinds) == sorted(KINDS)
    assert set(TRANSITION_LABELS) == set(TRANSITIONS)


@pytest.mark.parametrize(("minutes", "said"), [(0.0, "0:00"), (59.6, "1:00"), (460.0, "7:40")])
def test_minutes_are_said_as_hours(minutes: float, said: str) -> None:
    assert format_hours(minutes) == said


def test_a_moment_has_the_day_and_time_of_the_clock() -> None:
    live_result = daily.live(2.0)
    at_s = 7.5 * HOUR_S  # the recording begins at 18:00
    assert (find_day_label(live_result, at_s), clock_label(live_result, at_s)) == ("Tue 17 Nov", "01:30")
    assert find_midnight(live_result, at_s) == 6 * HOUR_S
    assert find_day_label(live_result, 3 * DAY_S) == ""


def test_without_a_clock_a_moment_counts_from_the_first_sample() -> None:
    live_result = daily.live(1.5, clock=False)
    assert (find_day_label(live_result, 25 * HOUR_S), clock_label(live_result, 25 * HOUR_S)) == (
        "Day 2",
        "01:00",
    )
    assert find_midnight(live_result, 25 * HOUR_S) == DAY_S
