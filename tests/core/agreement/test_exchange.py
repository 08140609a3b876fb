"""Labels from the joints: swaps are named and corrected; correct walks are unchanged."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement import Agreement, AgreementParams, check_agreement
from sagittal.core.agreement.agree import compare_sensors
from sagittal.core.agreement.exchange import LEGS, SWAPS, Swap, find_exchange, undo_exchange
from sagittal.core.agreement.params import ExchangeParams
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.walks import only, simulated


@cache
def walk() -> UniformRecording:
    simulation = simulated("comfortable", 1)[0]
    return only(simulation, *(s for s in simulation.sensors if s != "chest"))


def wrong(swap: Swap) -> UniformRecording:
    return replace(walk(), sensors=undo_exchange(swap, walk().sensors))


def pairs(result: Agreement) -> set[frozenset[str]]:
    assert result.exchange is not None
    return {frozenset(pair) for pair in result.exchange.swap}


def test_a_right_walk_fits_best_as_it_is() -> None:
    agreement = check_agreement(walk())
    assert agreement.recording is walk()
    assert agreement.exchange is not None
    assert agreement.exchange.swap == ()
    assert agreement.exchange.ratio < 0.9
    assert agreement.exchange.cosine is not None
    assert agreement.exchange.cosine > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("swap", [*SWAPS, LEGS, LEGS[1:]], ids=str)
def test_exchanged_sensors_are_named_and_put_back(swap: Swap) -> None:
    agreement = check_agreement(wrong(swap))
    assert pairs(agreement) == {frozenset(pair) for pair in swap}
    assert [n.code for n in agreement.recording.notices] == ["sensors_exchanged"]
    for segment, signals in agreement.recording.sensors.items():
        assert signals is walk().sensors[segment]


def test_exchanged_feet_are_told_and_left_where_so_configured() -> None:
    params = AgreementParams(exchange=ExchangeParams(repair=False))
    agreement = check_agreement(wrong((("foot_l", "foot_r"),)), params)
    assert pairs(agreement) == {frozenset(("foot_l", "foot_r"))}
    assert agreement.recording.notices[0].code == "sensors_exchanged"
    assert agreement.recording.sensors["foot_l"] is walk().sensors["foot_r"]


def test_exchanging_twice_changes_nothing() -> None:
    things = {"thigh_l": 1, "thigh_r": 2, "foot_l": 3, "foot_r": 4, "shank_l": 5, "shank_r": 6}
    assert undo_exchange(LEGS, undo_exchange(LEGS, things)) == things  # type: ignore[arg-type]


def test_a_leg_whose_other_side_is_not_worn_moves_over() -> None:
    segments = only(wrong(LEGS), "pelvis", "thigh_l", "thigh_r", "shank_r", "foot_r")
    agreement = check_agreement(segments)
    assert [n.code for n in agreement.recording.notices] == ["sensors_exchanged"]
    assert set(agreement.recording.sensors) == {"pelvis", "thigh_l", "thigh_r", "shank_l", "foot_l"}
    assert agreement.recording.sensors["foot_l"] is walk().sensors["foot_l"]


def test_without_a_pelvis_nobody_can_tell_legs_apart() -> None:
    legs = replace(walk(), sensors={s: x for s, x in wrong(LEGS).sensors.items() if s != "pelvis"})
    agreement = check_agreement(legs)
    assert agreement.exchange is not None
    assert agreement.exchange.cosine is None
    assert agreement.exchange.swap == ()


def test_people_who_stand_have_no_exchange() -> None:
    stand = {
        s: replace(x, acc=np.tile(x.acc[:1], (len(x.acc), 1)), gyr=np.zeros_like(x.gyr))
        for s, x in walk().sensors.items()
    }
    agreement = check_agreement(replace(walk(), sensors=stand))
    assert agreement.recording.notices == ()
    assert agreement.exchange is not None
    assert agreement.exchange.swap == ()


def test_terms_are_kept_as_long_as_labels_are_judged_and_judge_the_same() -> None:
    params = AgreementParams()
    short = replace(params.exchange, over_s=8.0)
    joints, terms = compare_sensors(walk(), params.joints)
    same, retained = compare_sensors(walk(), params.joints, over_s=8.0)
    assert list(retained) == list(terms)
    for a, b in zip(joints, same, strict=True):
        np.testing.assert_array_equal(a.places, b.places)
    for s, x in terms.items():
        assert x.is_whole
        assert not retained[s].is_whole
        np.testing.assert_array_equal(retained[s].M, x.M[: len(retained[s].M)])
    rate = walk().rate_hz
    assert find_exchange(retained, same, rate, params.joints, short) == find_exchange(
        terms, joints, rate, params.joints, short
    )


@pytest.mark.slow
def test_exchanged_sensors_of_a_long_walk_are_compared_anew() -> None:
    """Longer than their labels are judged on, so that no terms of the whole are left."""
    swap: Swap = (("thigh_l", "thigh_r"),)
    params = AgreementParams(exchange=ExchangeParams(over_s=8.0))
    agreement = check_agreement(wrong(swap), params)
    assert pairs(agreement) == {frozenset(swap[0])}
    assert (
        agreement.misfits == check_agreement(wrong(swap)).misfits == check_agreement(walk(), params).misfits
    )
