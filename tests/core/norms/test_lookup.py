"""One person and the reference that fits, or none and why."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY
from sagittal.core.norms import NormValue, look_up_norms, predict_at_speed
from sagittal.core.norms.place import percentile_of_sample, percentile_of_z, place_difference, place_value
from sagittal.core.norms.speed import walking_speed
from sagittal.core.norms.values import pace_of

REFERENCE = NormValue("x", mean=60.0, sd=4.0, n=42, group="g", source="s")


def norm(**changes: Any) -> NormValue:
    return replace(REFERENCE, **changes)


def test_a_value_gets_its_z_and_percentile() -> None:
    upper = place_value(68.0, norm())
    assert upper.z == pytest.approx(2.0)
    assert upper.percentile == pytest.approx(97.3, abs=0.1), "42 people: a little less sure than 97.7"
    assert upper.grade == 1
    assert place_value(60.0, norm()).percentile == pytest.approx(50.0)
    assert (place_value(55.0, norm()).grade, place_value(38.0, norm()).grade) == (0, 2)


def test_few_controls_make_no_extreme_percentile() -> None:
    """Crawford & Howell 1998: with five controls z = 2 is t = 1.826 with 4 degrees of freedom."""
    assert percentile_of_sample(2.0, 5) == pytest.approx(92.9, abs=0.1)
    assert percentile_of_sample(2.0, 100_000) == pytest.approx(percentile_of_z(2.0), abs=0.01)
    assert percentile_of_z(1.0) == pytest.approx(84.134, abs=0.001)


@pytest.mark.parametrize(
    ("value", "reference", "reason"),
    [
        (None, norm(), "no_value"),
        (60.0, None, "no_norm"),
        (60.0, norm(comparable=False, note="another zero"), "not_comparable"),
        (60.0, norm(sd=0.0), "no_spread"),
    ],
)
def test_no_place_says_why(value: float | None, reference: NormValue | None, reason: str) -> None:
    result = place_value(value, reference)
    assert (result.z, result.percentile, result.grade, result.reason) == (None, None, None, reason)


def test_differences_between_sides_compare_even_where_the_level_does_not() -> None:
    unlevel = norm(comparable=False, difference_sd=3.4)
    assert place_difference(50.0, 60.2, unlevel).z == pytest.approx(-3.0)
    assert place_difference(50.0, None, unlevel).reason == "no_value"
    assert place_difference(50.0, 60.0, norm()).reason == "no_norm"


def test_dimensionless_speed_makes_short_and_tall_people_alike() -> None:
    """Hof 1996; 0.29 and 0.43 are about 0.86 and 1.27 m/s on legs of 0.9 m."""
    leg = 0.53 * 1.698
    assert walking_speed(0.86, 1.698).dimensionless == pytest.approx(0.29, abs=0.002)
    assert walking_speed(1.27, 1.698).leg_m == pytest.approx(leg)
    small, tall = walking_speed(1.0, 1.5), walking_speed(1.0 * sqrt(1.9 / 1.5), 1.9)
    assert small.dimensionless == pytest.approx(tall.dimensionless)
    assert small.equivalent_mps == pytest.approx(tall.equivalent_mps)
    assert small.equivalent_mps > 1.0
    unknown = walking_speed(1.0)
    assert (unknown.dimensionless, unknown.equivalent_mps) == (None, 1.0)


def test_slower_than_anybody_has_no_norm_at_all() -> None:
    slow = look_up_norms(60, "female", speed_mps=0.2)
    assert (set(slow.values), dict(slow.bands)) == ({"gait_speed_mps"}, {})
    assert (slow.comfortable, slow.comfortable_bands) == ({}, {})
    assert (slow.reason, slow.timing_reason) == ("no_speed_matched_norm", "no_speed_matched_norm")
    assert slow.place("knee_flexion_rom_deg", 40.0).reason == "no_speed_matched_norm"
    assert slow.place("cadence_spm", 90.0).reason == "no_speed_matched_norm"


def test_gait_speed_itself_is_held_against_the_speed_people_like() -> None:
    """70 and older by age and sex (Hollman 2011), younger adults the 42 of the angle norms."""
    old = look_up_norms(72, "female", 0.5)
    assert old.place("gait_speed_mps", 0.5).z == pytest.approx((0.5 - 1.16) / 0.20)
    adult = look_up_norms(40, "female", 0.5)
    assert adult.place("gait_speed_mps", 0.5).z == pytest.approx((0.5 - 1.25) / 0.16)
    assert adult.values["gait_speed_mps"].n == 42
    assert look_up_norms(None, None, 1.25).place("gait_speed_mps", 1.25).z == pytest.approx(0.0)
    assert look_up_norms(8, "male", 1.2).place("gait_speed_mps", 1.2).reason == "not_comparable"


def test_the_limit_of_slowness_follows_the_legs() -> None:
    assert look_up_norms(60, "female", 0.235, height_m=1.45).reason is None
    assert look_up_norms(60, "female", 0.250, height_m=1.95).reason == "no_speed_matched_norm"
    assert not walking_speed(0.78, 1.45).is_slow
    assert walking_speed(0.82, 1.95).is_slow


@pytest.mark.parametrize(
    ("age", "speed", "pace"),
    [(25, 1.27, "normal"), (25, 1.7, "fast"), (25, 3.0, None), (75, 1.3, "normal"), (25, None, "normal")],
)  # fmt: skip
def test_the_walkway_norm_is_that_of_the_pace_walked(
    age: float, speed: float | None, pace: str | None
) -> None:
    """Below comfortable speed adults are held against people at their speed instead."""
    assert pace_of(25, "male", 1.0) == "slow"
    assert pace_of(25, "male", 0.82) is None
    assert pace_of(age, "male", speed) == pace
    norms = look_up_norms(age, "male", speed)
    assert norms.pace == pace
    if pace is None:
        assert norms.timing_reason == "no_speed_matched_norm"
        assert "cadence_spm" not in norms.values
        assert "knee_flexion_rom_deg" not in norms.values
    else:
        assert f"{pace} pace" in norms.values["cadence_spm"].group


@pytest.mark.parametrize("age", [None, 30, 65])
@pytest.mark.parametrize("height_m", [None, 1.65, 1.9])
def test_comfortable_walkers_are_no_norm_of_somebody_who_walks_faster_than_they_did(
    age: float | None, height_m: float | None
) -> None:
    """1.25 ± 0.16 m/s: at 1.68 m/s a healthy hip moves by 10° more than theirs."""
    fast, brisk = (look_up_norms(age, "male", v, height_m) for v in (1.70, 1.40))
    assert (fast.reason, dict(fast.bands)) == ("no_speed_matched_norm", {})
    assert fast.place("hip_flexion_rom_deg", 55.0).reason == "no_speed_matched_norm"
    assert fast.values["gait_speed_mps"].mean > 1.0, "speed itself keeps the speed that people like"
    assert (brisk.reason, "hip_flexion_rom_deg" in brisk.values) == (None, True)


def test_times_at_a_fast_speed_have_the_norm_of_the_fast_class_or_none() -> None:
    assert "fast pace" in look_up_norms(30, "male", 1.70).values["cadence_spm"].group
    old = look_up_norms(72, "female", 1.70)
    assert (old.timing_reason, "cadence_spm" in old.values) == ("no_speed_matched_norm", False)
    assert look_up_norms(72, "female", 1.40).timing_reason is None


def test_without_age_or_sex_angles_are_compared_and_times_are_not() -> None:
    norms = look_up_norms(None, None, 1.3)
    assert norms.place("knee_flexion_rom_deg", 64.69).z == pytest.approx(0.0)
    assert norms.place("cadence_spm", 100.0).reason == "age_unknown"
    assert look_up_norms(30, None, 1.3).place("cadence_spm", 100.0).reason == "sex_unknown"


def test_levels_compare_only_where_the_anatomical_level_is_known() -> None:
    standing = look_up_norms(30, "male", 1.3)
    assert standing.place("knee_flexion_max_swing_deg", 61.0).reason == "not_comparable"
    known_norms = look_up_norms(30, "male", 1.3, anatomical=("knee_flexion", "pelvis_tilt"))
    assert known_norms.place("knee_flexion_max_swing_deg", 61.08).z == pytest.approx(0.0)
    assert known_norms.place("hip_flexion_min_deg", -8.0).reason == "not_comparable"
    assert "depends on the protocol" in known_norms.bands["knee_flexion"].note
    assert "depends on the protocol" in known_norms.values["knee_flexion_max_swing_deg"].note
    assert known_norms.values["knee_flexion_rom_deg"].note == ""


def test_every_norm_shown_has_source_group_and_number_or_none() -> None:
    norms = look_up_norms(72, "female", 1.1, 1.62)
    for value in (*norms.values.values(), *norms.expected.values()):
        assert value.source
        assert value.group
        assert value.n is None or value.n > 10


def test_expected_step_and_cadence_multiply_to_the_speed_on_any_legs() -> None:
    for speed in np.linspace(0.5, 1.5, 6):
        for leg in (None, 0.78, 0.9, 1.05):
            e = predict_at_speed(float(speed), 30, leg)
            result = e["step_length_m"].mean * e["cadence_spm"].mean / 60.0
            assert result == pytest.approx(speed, rel=0.03), "two fits of the same walks"
    short, long = predict_at_speed(1.2, 30, 0.78), predict_at_speed(1.2, 30, 1.05)
    assert short["cadence_spm"].mean > long["cadence_spm"].mean
    assert sqrt(GRAVITY / 0.9) == pytest.approx(3.30, abs=0.01)


def test_children_have_times_and_no_angles() -> None:
    child = look_up_norms(8, "female", 1.2)
    assert (child.reason, child.timing_reason, child.pace) == ("no_norm_for_age", None, "normal")
    assert child.values["cadence_spm"].source == "Lythgo2011"
    assert child.place("knee_flexion_rom_deg", 60.0).reason == "no_norm_for_age"
    assert not child.expected
    assert look_up_norms(8, "female", 0.5).timing_reason == "no_speed_matched_norm"
