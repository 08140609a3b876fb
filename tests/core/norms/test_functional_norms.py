"""References of timed tests: as printed in their sources, and none where none was read."""

from __future__ import annotations

import pytest

from sagittal.core.norms.functional import (
    COMFORTABLE_SPEEDS,
    find_comfortable_speed,
    find_six_minute_norm,
    find_test_norm,
)
from sagittal.server.report.view.functional import NO_AGE, NO_SEX, OTHER_AGE, norm_words


@pytest.mark.parametrize(
    ("age", "sex", "expected"),
    [
        (45, "male", 1.43),
        (60, "female", 1.24),
        (69.5, "male", 1.34),
        (85, "female", 0.94),
        (99, "male", 0.97),
    ],
)
def test_comfortable_speed_by_age_and_sex(age: float, sex: str, expected: float) -> None:
    comfortable_speed = find_comfortable_speed(age, sex)
    assert comfortable_speed is not None
    assert comfortable_speed.mean_mps == expected


def test_comfortable_speed_ranges_as_the_abstract_says() -> None:
    means = [x for row in COMFORTABLE_SPEEDS.values() for x in row]
    assert (min(means), max(means)) == (0.94, 1.43)


def test_there_is_none_for_children_and_the_unknown() -> None:
    assert find_comfortable_speed(12, "male") is None
    assert find_comfortable_speed(40, "other") is None
    assert find_test_norm("tug_duration_s", 40) is None
    assert find_test_norm("tug_duration_s", None) is None


@pytest.mark.parametrize(
    ("age", "sex", "expected"),
    [
        (21, "female", 581.4),
        (75.9, "female", 581.4),
        (77.9, "male", 608.7),
        (20.9, "male", None),
        (76, "female", None),
    ],
)
def test_six_minutes_only_at_ages_that_were_measured(age: float, sex: str, expected: float | None) -> None:
    six_minute_norm = find_six_minute_norm(age, sex)
    assert (None if six_minute_norm is None else six_minute_norm.mean_m) == expected
    assert find_six_minute_norm(40, "other") is None


def test_six_minutes_are_told_with_their_source() -> None:
    notices = norm_words("walk_6min_distance_m", 50.0, "female")
    assert "581 m" in notices
    assert "Respir Res" in notices
    assert norm_words("walk_6min_distance_m", None, "male") == NO_AGE
    assert norm_words("walk_6min_distance_m", 50.0, None) == NO_SEX
    assert norm_words("walk_6min_distance_m", 90.0, "male") == OTHER_AGE
