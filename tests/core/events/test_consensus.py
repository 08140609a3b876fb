"""Detectors that agree, disagree and abstain: hand-made events and simulated people."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from sagittal.core import calibration
from sagittal.core.events import detect, detect_contacts
from sagittal.core.events.consensus import ConsensusParams, agree_on_contacts, all_detectors, rate_confidence
from sagittal.core.events.foot_movement import measure_foot_movements
from sagittal.core.events.result import GaitEvent, GaitEvents
from sagittal.core.frames import FOOT, SIDES
from sagittal.core.fusion.mahony import estimate_orientations
from tests.helpers.event_scoring import match
from tests.helpers.marks import slow_after
from tests.helpers.walks import simulated

PEOPLE = (
    "comfortable", "slow", "fast_with_turns", "hemiparetic", "drop_foot", "parkinson", "severe_shuffle",
    "elderly", "stiff_knee", "antalgic", "crouch",
)  # fmt: skip


def contacts(*times: float, source: str = "a") -> GaitEvents:
    return GaitEvents(tuple(GaitEvent(t, "left", "ic", source, t + 0.01) for t in times))


@cache
def detectors(name: str) -> dict[str, GaitEvents]:
    return all_detectors(estimate_orientations(calibration.calibrate(simulated(name)[0])))


def test_contacts_that_all_saw_have_full_confidence_and_the_leads_time() -> None:
    found = {"a": contacts(1, 2, 3, 4), "b": contacts(1.05, 2.06, 3.05, 4.05), "c": contacts(0.99, 2, 3, 4)}
    agreed = agree_on_contacts(found)
    assert agreed.times("left", "ic") == (1, 2, 3, 4)
    assert {e.confidence for e in agreed.events} == {1.0}
    assert {e.source for e in agreed.events} == {"consensus"}
    assert agreed.notices == ()


def test_a_contact_of_one_detector_in_three_is_left_out_and_counted() -> None:
    found = {"a": contacts(1, 2, 3, 4, 4.5), "b": contacts(1, 2, 3, 4), "c": contacts(1, 2, 3, 4)}
    agreed = agree_on_contacts(found)
    assert agreed.times("left", "ic") == (1, 2, 3, 4)
    assert [n.code for n in agreed.notices] == ["detectors_disagree"]


def test_a_contact_that_the_lead_missed_is_added_when_most_saw_it() -> None:
    found = {"a": contacts(1, 2, 4, 5), "b": contacts(1, 2, 3, 4, 5), "c": contacts(1, 2, 3.02, 4, 5)}
    agreed = agree_on_contacts(found)
    (added,) = (e for e in agreed.events if 2.5 < e.time_s < 3.5)
    assert added.confidence == pytest.approx(2 / 3)


def test_of_two_detectors_the_lead_is_believed_and_the_other_not() -> None:
    agreed = agree_on_contacts({"a": contacts(1, 2, 3), "b": contacts(1, 2, 4)})
    assert agreed.times("left", "ic") == (1, 2, 3)
    assert [e.confidence for e in agreed.events] == [1.0, 1.0, 0.5]


def test_a_detector_that_means_a_later_moment_still_agrees() -> None:
    late = tuple(t + 0.2 for t in (1, 2, 3, 4, 5))
    agreed = agree_on_contacts({"a": contacts(1, 2, 3, 4, 5), "b": contacts(*late)})
    assert {e.confidence for e in agreed.events} == {1.0}


def test_confidence_alone_adds_and_takes_away_nothing() -> None:
    lead = contacts(1, 2, 4)
    told = rate_confidence({"a": lead, "b": contacts(1, 2, 3)})
    assert [e.time_s for e in told.events] == [1, 2, 4]
    assert [e.confidence for e in told.events] == [1.0, 1.0, 0.5]
    alone = rate_confidence({"a": lead})
    assert [e.confidence for e in alone.events] == [None] * 3


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_after(4, PEOPLE))
def test_simulated_people_are_found_whole_or_said_to_be_led_by_another_detector(name: str) -> None:
    agreed = agree_on_contacts(detectors(name))
    truth = simulated(name)[1]
    for side in SIDES:
        result = match(agreed.times(side, "ic"), truth.contacts[side].contact.tolist(), 0.25)
        assert (result.missed, result.extra) == (0, ())
    codes = {n.code for n in agreed.notices}
    assert ("led_by_other" in codes) == ("no_toe_off" in codes) == (name == "severe_shuffle")


@pytest.mark.slow
def test_with_feet_alone_the_shuffle_stays_refused() -> None:
    take = estimate_orientations(calibration.calibrate(simulated("severe_shuffle")[0]))
    feet = replace(take, q={s: take.q[s] for s in FOOT.values()})
    agreed = agree_on_contacts(all_detectors(feet))
    assert agreed.events == ()
    assert "no_toe_off" in {n.code for n in agreed.notices}


def test_the_foot_pitch_events_keep_their_times_with_confidence() -> None:
    take = estimate_orientations(calibration.calibrate(simulated("comfortable")[0]))
    lead = detect(take)
    told = rate_confidence(all_detectors(take))
    assert [(e.time_s, e.kind, e.side) for e in told.events] == [
        (e.time_s, e.kind, e.side) for e in lead.events
    ]
    # out of standing a foot leaves the floor as not every other detector sees it
    unsure = [e for e in told.events if e.confidence != 1.0]
    assert [(e.kind, e.confidence) for e in unsure] == [("tc", 0.75)]


@pytest.mark.slow
def test_where_the_foot_pitch_rule_abstains_the_others_are_pointed_to() -> None:
    told = rate_confidence(detectors("severe_shuffle"))
    assert told.events == ()
    assert [n.code for n in told.notices] == ["no_toe_off"] * 2 + ["others_found_contacts"] * 2


def test_contacts_led_by_a_shank_are_corrected_and_say_how_uncertain_they_are() -> None:
    params = ConsensusParams()
    early = contacts(1, 2, 3, 4, 5)
    led = agree_on_contacts({"foot_contact": contacts(), "gouwanda": early, "catalfamo": early})
    assert led.times("left", "ic") == tuple(t + params.shank_early_s for t in (1, 2, 3, 4, 5))
    assert {e.uncertainty_s for e in led.events} == {params.shank_sd_s}
    foot = agree_on_contacts({"foot_contact": early, "gouwanda": early})
    assert foot.times("left", "ic") == (1, 2, 3, 4, 5), "where the foot leads its times stay"


def test_refined_contacts_lead_and_keep_time_and_uncertainty_in_a_consensus() -> None:
    calibrated = calibration.calibrate(simulated("comfortable")[0])
    take = estimate_orientations(calibrated)
    lead = detect_contacts(take, motions=measure_foot_movements(calibrated))
    agreed = agree_on_contacts(all_detectors(take, refined=lead))
    known = {(e.side, e.kind, e.time_s): e.uncertainty_s for e in lead.events}
    kept = [e for e in agreed.events if (e.side, e.kind, e.time_s) in known]
    assert len(kept) >= 0.95 * len(agreed.events)
    assert all(e.uncertainty_s == known[e.side, e.kind, e.time_s] for e in kept)
