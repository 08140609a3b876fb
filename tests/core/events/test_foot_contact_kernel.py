"""Parts of the contact loop as they are written: rates, knocks, landings, foot-offs and swings."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.events import contact_moments_kernel as moments
from sagittal.core.events import foot_contact_kernel as kernel
from sagittal.core.events.contact_moments_kernel import ContactRule
from sagittal.core.events.foot_contact import FootContactParams, FootContactState
from sagittal.core.events.foot_contact_kernel import (
    COUNTERS,
    FASTEST,
    SPEED,
    START,
    SUMS,
    TOLD,
    TOP,
    WAY,
)
from sagittal.core.frames import Floats
from sagittal.core.rotation import about
from tests.core.events.test_foot_contact import (
    PUSH_S,
    RATE,
    REST_S,
    SLAP_S,
    SWING_S,
    true_moments,
    walk_pitch,
)
from tests.helpers.uncompiled import run_uncompiled

PARAMS = FootContactParams()
T = np.arange(220) / RATE
NO_ACC = np.zeros((len(T), 3))


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    run_uncompiled(monkeypatch, kernel)


def rule() -> ContactRule:
    found: ContactRule = kernel._read_rule(FootContactState.start(RATE, None, PARAMS).refinement)
    return found


def test_every_parameter_arrives_under_its_name() -> None:
    found = rule()
    assert found.rate_hz == RATE
    for name in ("contact_share", "least_rad_s", "step_m", "dip_rad", "loose_sd_s", "late_sd_s"):
        assert getattr(found, name) == getattr(PARAMS, name)
    samples = {
        "leaving": 30, "after": 15, "quiet": 10, "apart": 1, "swing": 25, "longest": 200, "onset": 13,
        "pause": 300, "least": 12,
    }  # fmt: skip
    assert {name: getattr(found, name) for name in samples} == samples


def test_samples_are_found_in_a_ring() -> None:
    ring = np.array([4.0, 5.0, 1.0, 3.0])
    # samples 6, 7, 4, 5 … of the take: 1, 3 are the older ones
    assert moments.rate_at(ring, 3, 10.0) == 10.0
    assert moments.rate_at(ring, 2, 10.0) == 20.0
    assert moments.deepest(np.array([3.0, 1.0, 2.0, 2.5]), 10.0, 0, 2) == (0, -20.0)
    assert moments.highest(ring, 2, 5) == 5
    assert moments.lowest(ring, 2, 5) == 2
    acc = np.zeros((4, 3))
    acc[1] = (2.0, 3.0, 6.0)
    assert moments.knock_at(acc, 5, 1) == 7.0
    assert moments.knock_at(acc, 6, 2) == 0.0


def stride() -> tuple[Floats, int, int]:
    """Pitch of one stride, and the samples of its lowest and highest values."""
    pitch = walk_pitch(T, 1)
    return pitch, int(np.argmin(pitch)), int(np.argmax(pitch))


def test_a_clear_landing_is_where_the_slap_begins() -> None:
    pitch, bottom, top = stride()
    at, sd = moments.refine_landing(pitch, NO_ACC, top, bottom, top + 15, False, RATE, rule())
    assert at / RATE == pytest.approx(true_moments(1, PARAMS)[1][0], abs=1.5e-3)
    assert sd == PARAMS.contact_sd_s


def test_a_knock_pulls_the_landing_towards_it_and_widens_its_uncertainty() -> None:
    pitch, bottom, top = stride()
    acc = NO_ACC.copy()
    alone, _ = moments.refine_landing(pitch, acc, top, bottom, top + 15, False, RATE, rule())
    knock = top + 4
    acc[knock:] = (0.0, 0.0, 30.0)
    at, sd = moments.refine_landing(pitch, acc, top, bottom, top + 15, True, RATE, rule())
    assert at == pytest.approx(0.5 * (alone + knock - 0.5))
    assert sd == pytest.approx(np.hypot(PARAMS.contact_sd_s, (at - alone) / RATE))


def test_a_flat_landing_is_where_the_pitch_stops_to_rise() -> None:
    pitch = np.minimum(np.maximum(T - 0.5, 0.0), 0.3)
    top = int(np.argmax(pitch))
    at, sd = moments.refine_landing(pitch, NO_ACC, top, 20, top + 15, False, RATE, rule())
    assert at == pytest.approx(top - 0.2 + 0.5 - 0.5, abs=1.0)
    assert sd == PARAMS.flat_sd_s
    still, sd = moments.refine_landing(np.zeros(len(T)), NO_ACC, 100, 20, 115, False, RATE, rule())
    assert np.isnan(still)
    assert sd == PARAMS.late_sd_s
    acc = NO_ACC.copy()
    acc[top + 3 :] = (5.0, 0.0, 0.0)
    at, sd = moments.refine_landing(pitch, acc, top, 20, top + 15, True, RATE, rule())
    assert (at, sd) == (top + 3 - 0.5, PARAMS.flat_sd_s)


def test_a_clear_foot_off_is_where_the_push_ends() -> None:
    pitch, bottom, _ = stride()
    at, sd = moments.refine_leaving(pitch, bottom, 0, RATE, rule())
    true = true_moments(1, PARAMS)[0][0]
    assert at / RATE == pytest.approx(true, abs=1.5e-3)
    assert sd == pytest.approx(np.hypot(PARAMS.leaving_sd_s, 0.5 * (bottom - at) / RATE))


@pytest.mark.parametrize("why", ["shallow", "short", "long ago"])
def test_a_push_that_shows_nothing_gives_no_foot_off(why: str) -> None:
    pitch, bottom, _ = stride()
    first = 0
    if why == "shallow":
        pitch = 0.05 * pitch
    elif why == "short":
        first = bottom - 1
    else:
        end = round((REST_S + PUSH_S) * RATE)
        pitch = np.concatenate((pitch[:end], np.linspace(pitch[end], pitch[end] - 0.01, 20), pitch[end:]))
        bottom = end + 20
    at, sd = moments.refine_leaving(pitch, bottom, first, RATE, rule())
    assert np.isnan(at)
    assert sd == PARAMS.late_sd_s


def test_without_a_dip_the_foot_leaves_some_time_after_it_moves() -> None:
    flat = np.zeros(len(T))
    assert moments.guess_leaving(flat, 50, 90, 0, rule()) == (63, 63.0, 2.0 * PARAMS.loose_sd_s)
    assert moments.guess_leaving(flat, 50, 55, 0, rule())[:2] == (55, 55.0), "not beyond its middle"
    pitch, bottom, _ = stride()
    start = round(REST_S * RATE)
    found, at, sd = moments.guess_leaving(pitch, start, bottom + 20, 0, rule())
    assert found == bottom
    assert at == pytest.approx(moments.refine_leaving(pitch, bottom, 0, RATE, rule())[0])
    assert sd == PARAMS.loose_sd_s


def test_the_way_of_a_foot_is_its_acceleration_added_up_twice_in_the_world() -> None:
    sums = np.zeros(SUMS)
    q = about(2, 0.5 * np.pi)
    for _ in range(100):
        kernel._add_way(sums, q, np.array([1.0, 0.0, 9.8]), RATE)
    assert sums[[SPEED, SPEED + 1]] == pytest.approx([0.0, 1.0])
    assert sums[[WAY, WAY + 1]] == pytest.approx([0.0, 0.505])


@pytest.mark.parametrize(
    ("fastest", "way", "speed", "samples", "swings"),
    [
        (1.6, 0.3, 0.0, 60, True),
        (1.4, 0.3, 0.0, 60, False),
        (1.6, 0.09, 0.0, 60, False),
        (1.6, 0.3, 0.9, 60, False),
        (1.6, 0.3, 0.0, 24, False),
        (1.6, 0.3, 0.0, 25, True),
        (1.6, 0.3, 0.0, 201, False),
    ],
)
def test_a_swing_is_fast_long_and_leads_away(
    fastest: float, way: float, speed: float, samples: int, swings: bool
) -> None:
    """A speed that is left at the end is drift: half of the way that it makes is taken off."""
    sums = np.zeros(SUMS)
    sums[FASTEST], sums[WAY], sums[SPEED] = fastest, way, speed
    assert kernel._leads_far(sums, samples, 100 + samples, 100, RATE, rule()) == swings


def test_a_rise_that_ends_in_a_slap_is_a_landing_though_the_foot_moves_on() -> None:
    pitch, bottom, top = stride()
    counters = np.zeros(COUNTERS, np.int64)
    counters[START], counters[TOP] = bottom, top
    assert kernel._lands_between(pitch, counters, top + 15, RATE, rule())
    assert not kernel._lands_between(pitch, counters, top + 14, RATE, rule())
    counters[START] = top - 1
    assert not kernel._lands_between(pitch, counters, top + 15, RATE, rule())
    counters[START] = bottom
    assert not kernel._lands_between(0.1 * pitch, counters, top + 15, RATE, rule())


def test_a_movement_begins_with_nothing_added_up() -> None:
    counters, sums = np.zeros(COUNTERS, np.int64), np.ones(SUMS)
    kernel._begin_movement(counters, sums, 42, kernel.YES)
    assert counters[[START, TOP, TOLD]].tolist() == [42, 42, 1]
    assert sums.tolist() == [0.0] * 5 + [1.0] * (SUMS - 5)


def test_a_foot_off_too_near_to_its_contact_is_told_again() -> None:
    pitch = np.zeros(len(T))
    counters, sums = np.zeros(COUNTERS, np.int64), np.zeros(SUMS)
    counters[START], counters[kernel.LEFT], sums[kernel.LEFT_AT] = 60, 7, 100.0
    ints, floats = np.zeros((4, 4), np.int64), np.zeros((4, 2))

    def mend(at: float, reach: int = 0) -> int:
        told: int = kernel._mend_leaving(ints, floats, 0, pitch, counters, sums, 115, reach, at, rule())
        return told

    assert mend(112.0) == 0, "long enough for a swing"
    assert mend(111.0, reach=61) == 0, "its movement began before a gap"
    assert mend(111.0) == 1
    assert ints[0].tolist() == [0, 7, 115, 1]
    assert floats[0].tolist() == [73.0, 2.0 * PARAMS.loose_sd_s]


def test_the_durations_of_the_test_are_those_it_was_made_for() -> None:
    pitch, bottom, top = stride()
    assert bottom == pytest.approx((REST_S + PUSH_S) * RATE, abs=1)
    assert top == pytest.approx((REST_S + PUSH_S + SWING_S) * RATE, abs=1)
    assert pitch[round((REST_S + PUSH_S + SWING_S + SLAP_S) * RATE)] == pytest.approx(0.0, abs=1e-6)
