"""Rising and sitting down: before, between and after."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.simulate.gait.chair import (
    BACK,
    DROP,
    LEAN,
    PELVIS_LEAN,
    SEATED_CHEST,
    SEATED_TILT,
    ChairChange,
    SeatMotion,
    sit_and_rise,
)

T = np.arange(101) / 10.0
RISE, DOWN = ChairChange("sit_to_stand", 2.0, 4.0), ChairChange("stand_to_sit", 6.0, 8.0)


def at(result: SeatMotion, time_s: float) -> tuple[float, float, float, float]:
    k = round(10.0 * time_s)
    return (
        float(result.drop[k]),
        float(result.back[k]),
        float(result.pelvis_rad[k]),
        float(result.chest_rad[k]),
    )


SITS = pytest.approx((DROP, BACK, SEATED_TILT, SEATED_CHEST), abs=1e-12)
STANDS = pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-12)


def test_who_rises_first_sits_before_and_stands_after() -> None:
    transitions = sit_and_rise(T, (RISE, DOWN))
    for time_s, expected in (
        (0.0, SITS),
        (2.0, SITS),
        (4.0, STANDS),
        (6.0, STANDS),
        (8.0, SITS),
        (10.0, SITS),
    ):
        assert at(transitions, time_s) == expected, time_s


def test_who_sits_down_first_stands_before() -> None:
    transitions = sit_and_rise(T, (DOWN,))
    assert at(transitions, 0.0) == STANDS
    assert at(transitions, 9.0) == SITS


def test_without_a_change_nothing_is_added() -> None:
    transitions = sit_and_rise(T, ())
    assert not any(
        x.any() for x in (transitions.drop, transitions.back, transitions.pelvis_rad, transitions.chest_rad)
    )


def test_halfway_the_trunk_leans_most_and_further_than_the_pelvis() -> None:
    for change, middle in ((RISE, 3.0), (DOWN, 7.0)):
        _, back, pelvis, chest = at(sit_and_rise(T, (change,)), middle)
        assert back == pytest.approx(0.5 * BACK)
        assert pelvis == pytest.approx(PELVIS_LEAN + 0.5 * SEATED_TILT)
        assert chest == pytest.approx(LEAN + 0.5 * SEATED_CHEST)


def test_going_up_the_seat_is_left_late_and_going_down_it_is_met_early() -> None:
    up, down = sit_and_rise(T, (RISE,)), sit_and_rise(T, (DOWN,))
    # the first three tenths of two seconds lean only, and so do the last three of the way down
    assert at(up, 2.6)[0] == pytest.approx(DROP)
    assert at(up, 2.7)[0] < DROP
    assert at(up, 2.6)[1] < BACK
    assert at(down, 7.4)[0] == pytest.approx(DROP)
    assert at(down, 7.3)[0] < DROP
    assert at(down, 7.4)[1] < BACK
