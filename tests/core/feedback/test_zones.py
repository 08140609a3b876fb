"""Levels are equidistant and widen one side only; the sound grows with the error above the dead band."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.feedback.prescription import LEVELS, Towards
from sagittal.core.feedback.zones import BASE_HZ, LOUDEST_SD, Zones

levels = st.integers(0, LEVELS)
values = st.floats(-50.0, 50.0)
sides = st.sampled_from(("low", "high"))


def zones(worse: Towards | None = "low", band: float = 1.0, width: float = 1.0) -> Zones:
    return Zones(10.0, 2.0, band, width, worse)


def test_a_level_is_one_sd_and_the_overshoot_side_stays_as_at_level_0() -> None:
    assert [zones().limits(level) for level in (0, 1, 2)] == [(8.0, 12.0), (6.0, 12.0), (4.0, 12.0)]
    assert [zones("high").limits(level) for level in (0, 1, 2)] == [(8.0, 12.0), (8.0, 14.0), (8.0, 16.0)]


@pytest.mark.parametrize(
    ("value", "zone"),
    [(10.0, "in"), (6.0, "in"), (5.9, "near_low"), (4.0, "near_low"), (3.9, "low"), (12.1, "near_high"),
     (14.0, "near_high"), (14.1, "high")],
)  # fmt: skip
def test_yellow_is_one_level_beside_green_and_both_know_their_side(value: float, zone: str) -> None:
    assert zones().zone(value, 1) == zone


@given(usual=values, band=st.floats(0.1, 5.0), width=st.floats(0.1, 5.0))
def test_the_start_level_is_the_hardest_whose_zone_holds_what_is_usual(
    usual: float, band: float, width: float
) -> None:
    z = zones(zones().side_of(usual), band, width)
    level = z.start_level(usual)
    assert 0 <= level <= LEVELS
    low, high = z.limits(level)
    assert level == LEVELS or low - 1e-6 <= usual <= high + 1e-6
    if level > 0:
        low, high = z.limits(level - 1)
        assert not low + 1e-6 < usual < high - 1e-6


@given(value=values, level=levels, worse=sides)
def test_a_value_is_green_exactly_within_the_limits_and_silent_there(
    value: float, level: int, worse: Towards
) -> None:
    z = zones(worse)
    low, high = z.limits(level)
    assert (z.zone(value, level) == "in") == (low <= value <= high)
    assert (z.tone(value, level) is None) == (low <= value <= high)


@given(small=st.floats(0.001, 6.0), more=st.floats(0.0, 6.0), worse=sides, level=levels)
def test_a_larger_error_never_sounds_lower_or_softer(
    small: float, more: float, worse: Towards, level: int
) -> None:
    z = zones(worse)
    for limit, sign in zip(z.limits(level), (-1.0, 1.0), strict=True):
        near, far = z.tone(limit + sign * small, level), z.tone(limit + sign * (small + more), level)
        assert near is not None
        assert far is not None
        assert BASE_HZ <= near.pitch <= far.pitch <= 2.0 * BASE_HZ
        assert 0.0 < near.level <= far.level <= 1.0


def test_three_sd_above_the_dead_band_is_an_octave_and_full_level() -> None:
    tone = zones().tone(8.0 - LOUDEST_SD * 2.0, 0)
    assert tone is not None
    assert [tone.pitch, tone.level] == pytest.approx([880.0, 1.0])
