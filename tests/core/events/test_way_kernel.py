"""Parts of the loop over swings by their way as they are written: levels, crossings, landings."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.events import way_kernel as kernel
from sagittal.core.events.foot_way import FootWayParams, FootWayState
from sagittal.core.events.way_kernel import ACC_X, BINS, LOWEST_RATE, TRACK, WayRule
from tests.helpers.uncompiled import run_uncompiled

RATE = 100.0
PARAMS = FootWayParams()


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    run_uncompiled(monkeypatch, kernel)


def rule() -> WayRule:
    found: WayRule = kernel._read_rule(FootWayState.start(RATE, PARAMS).rule)
    return found


def test_every_parameter_arrives_under_its_name() -> None:
    found = rule()
    assert found.rate_hz == RATE
    for name in ("leaving_share", "floor_rad_s", "calm_mps2", "tilt_mps2", "edge_on", "last_share", "sd_s"):
        assert getattr(found, name) == getattr(PARAMS, name)
    samples = {
        "chord": 10,
        "hold": 5,
        "long": 30,
        "shortest": 15,
        "longest": 350,
        "landing": 20,
        "lately": 200,
    }
    assert {name: getattr(found, name) for name in samples} == samples
    assert found.late_sd_s == PARAMS.sd_s


def test_the_split_lies_between_two_kinds_of_rates() -> None:
    counts = np.zeros(BINS)
    assert kernel.split_in_two(counts) == 0.0
    for rate in (*np.linspace(0.05, 0.1, 60), *np.linspace(1.0, 3.0, 40)):
        kernel.count_rate(counts, float(rate))
    assert 0.1 <= kernel.split_in_two(counts) <= 1.0
    kernel.count_rate(counts, 0.0)
    kernel.count_rate(counts, 1e6)
    assert counts.sum() == 102.0
    assert counts[0] == 1.0 == counts[-1]
    assert LOWEST_RATE > 0.0


def test_a_tremor_turns_nothing_over_its_period() -> None:
    turns = np.zeros((20, 4))
    angle = 0.05 * np.sin(2.0 * np.pi * np.arange(20) / 10.0)
    turns[:, 0], turns[:, 1] = np.cos(angle / 2.0), np.sin(angle / 2.0)
    assert kernel._chord(turns, 15, 10, RATE) == pytest.approx(0.0, abs=1e-6)
    assert kernel._chord(turns, 17, 5, RATE) > 1.0


def test_what_a_tilt_leaves_is_taken_off_and_no_more() -> None:
    track = np.zeros((40, TRACK))
    track[:, ACC_X] = 0.3
    assert kernel._rest_force(track, 5, 15, 0.5) == pytest.approx((0.3, 0.0))
    track[:, ACC_X] = 4.0
    assert kernel._rest_force(track, 5, 15, 0.5) == pytest.approx((0.5, 0.0)), "the foot was moving"


def test_the_way_of_a_movement_between_rests_is_what_its_acceleration_adds_up_to() -> None:
    n = 100
    track, course = np.zeros((n, TRACK)), np.zeros((n, 2))
    u = np.clip((np.arange(n) - 30) / 40.0, 0.0, 1.0)
    # 0.4 m in 0.4 s, beside what a tilt of 1.7° leaves
    track[:, ACC_X] = 0.4 * 2.0 * np.pi / 0.16 * np.sin(2.0 * np.pi * u) + 0.3
    x, y = kernel._follow(track, course, 25, 85, rule())
    assert (x, y) == pytest.approx((0.4, 0.0), abs=0.01)
    top = kernel.find_fastest(course, 25, 85, 1.0, 0.0)
    assert top == pytest.approx(50, abs=1)
    off, sd = kernel.place_leaving(track, course, 25, top, 1.0, 0.0, rule())
    assert 30 < off < 38
    assert sd == 2.0 * PARAMS.sd_s
    knocks = np.zeros((n, 3))
    assert 62 < kernel.place_landing(course, knocks, top, 85, 1.0, 0.0, rule()) < 70, "by the speed"
    knocks[68:, 2] = 20.0
    assert kernel.place_landing(course, knocks, top, 85, 1.0, 0.0, rule()) == pytest.approx(67.5)
