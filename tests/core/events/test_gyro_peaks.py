"""The gyro-peak detector: its features on a hand-made rate, its presets on people, what it refuses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core import calibration
from sagittal.core.errors import SignalError
from sagittal.core.events.gyro_peaks import (
    LIMB,
    GyroPeakParams,
    GyroPeakPresets,
    gyro_peak_events,
    sagittal_rate,
)
from sagittal.core.frames import R_NEUTRAL, SIDES, Floats
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, from_matrix, multiply
from tests.helpers.event_scoring import match
from tests.helpers.walks import simulated

PRESETS = GyroPeakPresets().by_name

RATE = 100.0
PEOPLE = (
    "comfortable",
    "slow",
    "fast_with_turns",
    "drop_foot",
    "crouch",
    "antalgic",
    "elderly",
    "stiff_knee",
)


def swinging(t: Floats) -> Floats:
    """Sagittal rate with one swing a second: minimum −3 rad/s at .3, peak 5 at .5, zero at .65, −2 at .7."""
    knots = [0.0, 0.15, 0.3, 0.4, 0.5, 0.65, 0.7, 0.8, 1.0]
    values = [0.0, -0.5, -3.0, 0.0, 5.0, 0.0, -2.0, 0.0, 0.0]
    return np.asarray(np.interp(t % 1.0, knots, values)) * ((t > 2.0) & (t < 12.0))


def shanks(rate: Floats, heading: float = 0.0) -> Orientations:
    """Both shanks turning at a rate about their rightward axis."""
    pitch = np.concatenate(([0.0], np.cumsum(rate)[:-1])) / RATE
    # rightward is −y of the world in neutral standing
    q = multiply(about(2, np.full(len(rate), heading)), about(1, -pitch))
    q = multiply(q, from_matrix(R_NEUTRAL))
    valid = np.ones(len(rate), np.bool_)
    t = np.arange(len(rate)) / RATE
    return Orientations(t, RATE, {"shank_l": q, "shank_r": q}, {"shank_l": valid, "shank_r": valid}, "made")


@cache
def walked(name: str) -> Orientations:
    return estimate_orientations(calibration.calibrate(simulated(name)[0]))


T = np.arange(1500) / RATE


def test_the_rate_is_that_of_the_segment_whatever_its_heading() -> None:
    for heading in (0.0, 2.0):
        found = sagittal_rate(shanks(swinging(T), heading).q["shank_l"], RATE)
        assert np.allclose(found[:-1], swinging(T)[:-1], atol=1e-6)


@pytest.mark.parametrize(("contact", "at"), [("zero_cross", 0.65), ("neg_peak", 0.70)])
def test_the_contact_is_the_chosen_feature_after_the_swing(contact: str, at: float) -> None:
    params = GyroPeakParams(contact=contact)  # type: ignore[arg-type]
    times = gyro_peak_events(shanks(swinging(T)), RATE, params).times("left", "ic")
    assert len(times) == 10
    assert np.allclose(np.array(times) % 1.0, at, atol=0.01)


@pytest.mark.parametrize("leaving", ["before_swing", "deepest"])
def test_the_terminal_contact_is_a_minimum_before_the_swing(leaving: str) -> None:
    params = GyroPeakParams(leaving=leaving)  # type: ignore[arg-type]
    events = gyro_peak_events(shanks(swinging(T)), RATE, params)
    assert np.allclose(np.array(events.times("right", "tc")) % 1.0, 0.30, atol=0.01)
    assert all(e.detected_s >= e.time_s for e in events.events)
    assert {e.source for e in events.events} == {"gyro_peaks"}


def test_two_minima_are_told_apart_by_the_rule() -> None:
    rate = swinging(T) + 2.0 * np.exp(-((((T % 1.0) - 0.33) / 0.012) ** 2)) * (T > 2.0) * (T < 12.0)
    last = gyro_peak_events(shanks(rate), RATE, GyroPeakParams(leaving="before_swing"))
    deepest = gyro_peak_events(shanks(rate), RATE, GyroPeakParams(leaving="deepest"))
    assert last.times("left", "tc")[0] - deepest.times("left", "tc")[0] > 0.03


def test_the_refractory_time_and_the_threshold_keep_small_swings_out() -> None:
    twice = swinging(T) + 3.0 * np.exp(-((((T % 1.0) - 0.62) / 0.02) ** 2)) * (T > 2.0) * (T < 12.0)
    assert len(gyro_peak_events(shanks(twice), RATE).times("left", "ic")) == 10
    none = gyro_peak_events(shanks(0.1 * swinging(T)), RATE)
    assert none.events == ()
    assert [n.code for n in none.notices] == ["no_swing", "no_swing"]


def test_swings_around_the_threshold_are_refused_not_half_reported() -> None:
    size = np.where(np.floor(T) % 2 == 0, 0.40, 0.30)
    found = gyro_peak_events(shanks(size * swinging(T)), RATE)
    assert found.events == ()
    assert [n.code for n in found.notices] == ["swing_unclear", "swing_unclear"]


def test_nothing_is_reported_across_lost_samples() -> None:
    take = shanks(swinging(T))
    lost = np.ones(len(T), np.bool_)
    lost[560:565] = False
    found = gyro_peak_events(replace(take, valid={"shank_l": lost, "shank_r": ~(~lost)}), RATE)
    assert len(found.times("left", "ic")) == 9


def test_a_missing_segment_and_a_low_rate_are_said() -> None:
    take = shanks(swinging(T))
    one = replace(take, q={"shank_l": take.q["shank_l"]}, valid={"shank_l": take.valid["shank_l"]})
    assert [n.code for n in gyro_peak_events(one, RATE).notices] == ["segment_missing"]
    with pytest.raises(SignalError) as slow:
        gyro_peak_events(take, 30.0)
    assert slow.value.code == "sample_rate_too_low"


def test_there_are_five_presets_of_foot_and_shank() -> None:
    assert set(PRESETS) == {"gouwanda", "catalfamo", "maqbool", "mariani", "perez_ibarra"}
    assert all(PRESETS[n].name == n for n in PRESETS)
    assert {p.segment for p in PRESETS.values()} == set(LIMB)


@pytest.mark.slow
@pytest.mark.parametrize("name", PEOPLE)
@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_presets_find_the_contacts_of_simulated_people(name: str, preset: str) -> None:
    events = gyro_peak_events(walked(name), RATE, PRESETS[preset])
    truth = simulated(name)[1]
    for side in SIDES:
        contact = match(events.times(side, "ic"), truth.contacts[side].contact.tolist(), 0.25)
        assert contact.missed <= 0.2 * len(truth.contacts[side].contact), side
        assert len(contact.extra) <= 1, side


def test_the_shuffle_that_hardly_lifts_a_foot_is_refused_by_the_feet_and_found_by_the_shanks() -> None:
    take, truth = walked("severe_shuffle"), simulated("severe_shuffle")[1]
    for preset in ("mariani", "perez_ibarra"):
        refused = gyro_peak_events(take, RATE, PRESETS[preset])
        assert refused.events == ()
        assert {n.code for n in refused.notices} == {"swing_unclear"}
    for side in SIDES:
        found = match(
            gyro_peak_events(take, RATE, PRESETS["gouwanda"]).times(side, "ic"),
            truth.contacts[side].contact.tolist(),
            0.25,
        )
        assert (found.missed, found.extra) == (0, ())


def test_twice_the_cadence_is_found() -> None:
    rate = swinging(2.0 * T)
    assert len(gyro_peak_events(shanks(rate), RATE, GyroPeakParams(wait_s=0.05)).times("left", "ic")) == 10
