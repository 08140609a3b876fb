"""Accelerometers whose signs are turned round are found by the joints that then fit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement.mirrored import find_mirrored, turn_round
from sagittal.core.agreement.params import ExchangeParams, JointParams
from sagittal.core.agreement.terms import TermsPart
from sagittal.core.agreement.windows import compare_at_joint
from sagittal.core.frames import Segment
from tests.core.agreement.chained_terms import make_terms

JOINTS: tuple[tuple[Segment, Segment], ...] = (("thigh_l", "shank_l"), ("shank_l", "foot_l"))
PARAMS = JointParams()


@cache
def right() -> dict[Segment, TermsPart]:
    return make_terms()


def find(terms: dict[Segment, TermsPart], least: float = 1.3) -> tuple[frozenset[Segment], float]:
    misfits = {
        frozenset((a, b)): float(np.median(compare_at_joint((a, b), terms[a], terms[b], PARAMS).residual))
        for a, b in JOINTS
    }
    return find_mirrored(terms, misfits, JOINTS, PARAMS, ExchangeParams(mirrored=least))


def mirror(segment: Segment) -> dict[Segment, TermsPart]:
    return {**right(), segment: turn_round(right()[segment])}


def test_turning_round_changes_the_force_and_levels_anew() -> None:
    terms = right()["foot_l"]
    turned = turn_round(terms).M
    np.testing.assert_array_equal(turned[:, 0, :3], terms.M[:, 0, :3])
    np.testing.assert_array_equal(turned[:, 0, 3], -terms.M[:, 0, 3])
    np.testing.assert_array_equal(turned[:, 1:, :3], -terms.M[:, 1:, :3])
    np.testing.assert_array_equal(turned[:, 1:, 3], terms.M[:, 1:, 3])
    np.testing.assert_array_equal(turn_round(turn_round(terms)).M, terms.M)


def test_nobody_is_mirrored_where_the_joints_fit() -> None:
    assert find(right()) == (frozenset(), 0.0)


@pytest.mark.parametrize("segment", ["thigh_l", "shank_l", "foot_l"])
def test_the_sensor_with_wrong_signs_is_found_by_its_joints(segment: Segment) -> None:
    matches, gain = find(mirror(segment))
    assert matches == {segment}
    joints = 2 if segment == "shank_l" else 1
    assert gain > joints * 2.0
    assert find(mirror(segment), least=float(np.exp(gain + 0.1))) == (frozenset(), 0.0)


def test_a_joint_that_fits_badly_either_way_says_nothing() -> None:
    terms = right()
    rng = np.random.default_rng(5)
    strange = replace(terms["foot_l"], M=4.0 * rng.standard_normal(terms["foot_l"].M.shape))
    misfits = {frozenset(j): 3.0 for j in JOINTS}
    inputs = {**terms, "foot_l": strange}
    assert find_mirrored(inputs, misfits, JOINTS[1:], PARAMS, ExchangeParams()) == (frozenset(), 0.0)


def test_what_was_never_compared_gains_nothing() -> None:
    assert find_mirrored(mirror("foot_l"), {}, JOINTS, PARAMS, ExchangeParams()) == (frozenset(), 0.0)
