"""Limits of change: each with its people and its source, by speed and by limb, and one's own."""

from __future__ import annotations

from math import sqrt

import pytest

from sagittal.core.change.limits import (
    ChangeLimit,
    Limb,
    detectable_ratio,
    estimate_repeatability,
    find_detectable_change,
    find_relevant_change,
)


@pytest.mark.parametrize(
    ("before", "limit"), [(0.0, 0.10), (0.39, 0.10), (0.40, 0.15), (0.79, 0.15), (0.80, 0.18), (2.0, 0.18)]
)
def test_speed_has_a_limit_by_how_fast_somebody_walked(before: float, limit: float) -> None:
    result = find_detectable_change("gait_speed_mps", before)
    assert result is not None
    assert result.value == limit


@pytest.mark.parametrize(
    ("name", "limb", "detectable", "relevant"),
    [
        ("knee_flexion_rom_deg", "affected", 1.96 * sqrt(2.0) * 1.86, 8.48),
        ("knee_flexion_rom_deg", "unaffected", 1.96 * sqrt(2.0) * 5.63, 6.81),
        ("knee_flexion_rom_deg", None, 1.96 * sqrt(2.0) * 5.63, 8.48),
        ("hip_flexion_rom_deg", "affected", 1.96 * sqrt(2.0) * 1.56, 5.81),
        ("hip_flexion_rom_deg", "unaffected", 1.96 * sqrt(2.0) * 1.04, 2.86),
        ("hip_flexion_rom_deg", None, 1.96 * sqrt(2.0) * 1.56, 5.81),
    ],
)
def test_ranges_have_limits_by_limb_and_the_larger_one_where_no_side_is_affected(
    name: str, limb: Limb | None, detectable: float, relevant: float
) -> None:
    for result, value in (
        (find_detectable_change(name, 50.0, limb), detectable),
        (find_relevant_change(name, limb), relevant),
    ):
        assert result is not None
        assert result.value == pytest.approx(value)
        assert "Guzik" in result.source


def test_what_no_source_limits_has_no_limit() -> None:
    assert find_detectable_change("no_such_parameter", 1.0) is None
    assert find_relevant_change("no_such_parameter") is None
    assert find_relevant_change("step_length_m") is None
    assert detectable_ratio("step_width_m") is None


def test_a_score_is_found_by_its_own_name() -> None:
    result = find_relevant_change("gps_deg")
    assert result is not None
    assert (result.value, result.people) == (1.6, "children")
    assert find_detectable_change("gps_deg", 8.0) is None


@pytest.mark.parametrize(
    ("name", "limit"), [("step_length_m", 0.15), ("swing_time_s", 0.26), ("stance_time_s", 0.09)]
)
def test_ratios_have_limits_of_their_own(name: str, limit: float) -> None:
    result = detectable_ratio(name)
    assert result is not None
    assert result.value == limit
    assert "Lewek & Randall 2011" in result.source


def test_the_error_within_people_is_pooled_by_their_freedom() -> None:
    repeatability = estimate_repeatability(
        [[60.0, 62.0], [50.0, 51.0], [55.0, 55.0], [70.0, 72.0], [64.0, 63.0], [9.0]]
    )
    assert repeatability is not None
    # pooled within-person variance (2 + .5 + 0 + 2 + .5) / 5 = 1
    assert repeatability.sem == pytest.approx(1.0)
    assert (repeatability.people, repeatability.repeats) == (5, 10)
    assert repeatability.mdc95 == pytest.approx(2.772, abs=0.001)
    uneven = estimate_repeatability([[1.0, 3.0, 5.0], *[[2.0, 2.0]] * 4])
    assert uneven is not None
    assert uneven.sem == pytest.approx(sqrt(8.0 / 6.0))
    assert uneven.repeats == 11


def test_fewer_than_five_people_measured_twice_give_no_limit() -> None:
    assert estimate_repeatability([[1.0, 2.0]] * 4) is None
    assert estimate_repeatability([[1.0, 2.0]] * 4 + [[1.0], []]) is None
    assert estimate_repeatability([[1.0, 2.0]] * 5) is not None


def test_an_own_limit_says_whose_it_is() -> None:
    repeatability = estimate_repeatability([[0.0, 2.0]] * 6)
    assert repeatability is not None
    assert repeatability.limit == ChangeLimit(
        repeatability.mdc95, "6 people of this clinic", "own repeated measurements, n = 6"
    )


def test_every_limit_names_people_and_source() -> None:
    names = [
        "gait_speed_mps", "step_length_m", "stance_pct", "knee_flexion_rom_deg", "hip_flexion_rom_deg",
        "hip_flexion_min_deg", "knee_flexion_max_swing_deg",
    ]  # fmt: skip
    limits = [find_detectable_change(n, 0.5) for n in names] + [
        detectable_ratio("step_length_m"),
        find_relevant_change("gps_deg"),
    ]
    for limit in limits:
        assert limit is not None
        assert limit.value > 0
        assert limit.people
        assert limit.source
    assert find_detectable_change("stance_time_s", 0.7) is None
    assert find_relevant_change("step_width_m") is None
