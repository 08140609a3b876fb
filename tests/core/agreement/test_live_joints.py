"""Joints second by second: pairs that are compared, names that fit, and the last windows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.agreement.exchange import Swap
from sagittal.core.agreement.live_joints import KEPT, LivePair, list_pairs, relabel
from sagittal.core.agreement.live_terms import TermSecond
from sagittal.core.agreement.params import JointParams
from sagittal.core.agreement.windows import JointWindows
from sagittal.core.frames import Segment
from tests.core.agreement.chained_terms import KNEE, RATE_HZ, make_terms

PARAMS = JointParams()
CHUNK = 50
AROUND = round(PARAMS.widest_s * RATE_HZ)


def seconds(count: int) -> Iterable[TermSecond]:
    """Thigh and shank, each second with its context."""
    terms = make_terms(count + 1)
    M = np.stack([terms["thigh_l"].M, terms["shank_l"].M])
    usable = np.ones(M.shape[:2], np.bool_)
    for k in range(count):
        part = slice(k * CHUNK, (k + 1) * CHUNK + 2 * AROUND)
        power = np.array([1.0 + k, 2.0])
        yield TermSecond(
            np.ascontiguousarray(M[:, part]), np.ascontiguousarray(usable[:, part]), 0, power, np.zeros(0)
        )


def knee() -> LivePair:
    return LivePair(("thigh_l", "shank_l"), RATE_HZ, CHUNK, PARAMS)


def test_a_window_is_said_once_it_is_full_and_the_joint_is_where_it_is() -> None:
    pair = knee()
    frames = [pair.push(x, (0, 1), 10.0 + k) for k, x in enumerate(seconds(8))]
    assert frames == [False] * 5 + [True] * 3
    assert len(pair) == 3
    content = pair.read()
    assert (content.first, content.second) == ("thigh_l", "shank_l")
    assert content.t_s.tolist() == [15.0, 16.0, 17.0]
    assert content.lag_s == pytest.approx(0.0, abs=1e-3)
    assert content.residual.max() < 0.05
    assert content.places == pytest.approx(np.tile(np.concatenate(KNEE), (3, 1)), abs=0.01)
    assert (content.width_s, content.step_s) == (6.0, 1.0)
    swing = pair.read_swing()
    assert swing["thigh_l"].tolist() == [3.5, 4.5, 5.5]
    assert swing["shank_l"].tolist() == [2.0] * 3


def test_a_lost_second_says_nothing_and_is_forgotten_again() -> None:
    pair = knee()
    items = list(seconds(14))
    for k in (2, 5):
        items[k].usable[0] = False
    frames = [pair.push(x, (0, 1), float(k)) for k, x in enumerate(items)]
    # five of six seconds are enough
    assert frames == [False] * 8 + [True] * 6


def test_only_the_last_windows_are_kept() -> None:
    pair = knee()
    (one,) = seconds(1)
    for k in range(KEPT + 7):
        pair.push(one, (0, 1), float(k))
    assert len(pair) == KEPT
    times = pair.read().t_s
    assert (times[0], times[-1], len(times)) == (7.0, KEPT + 6.0, KEPT)


def test_pairs_are_the_joints_and_what_exchanges_would_make_of_them() -> None:
    assert list_pairs(("shank_l", "foot_l")) == (("shank_l", "foot_l"),)
    assert list_pairs(("shank_l", "foot_r")) == ()
    knees = list_pairs(("thigh_l", "thigh_r", "shank_l", "shank_r"))
    assert knees[:2] == (("thigh_l", "shank_l"), ("thigh_r", "shank_r"))
    assert set(knees[2:]) == {("thigh_r", "shank_l"), ("thigh_l", "shank_r")}


def windows(first: Segment, second: Segment) -> JointWindows:
    one = np.ones(1)
    places = np.arange(6.0)[None]
    return JointWindows(first, second, one, 0.02 * one, one > 0, one, places, 0.1 * one, 6.0, 1.0)


def test_windows_get_the_labels_that_fit() -> None:
    swap: Swap = (("shank_l", "foot_l"),)
    inputs = [windows("thigh_l", "foot_l"), windows("shank_l", "foot_l"), windows("thigh_r", "shank_r")]
    result = relabel(swap, {frozenset((w.first, w.second)): w for w in inputs})
    assert set(result) == {("thigh_l", "shank_l"), ("shank_l", "foot_l"), ("thigh_r", "shank_r")}
    knee = result["thigh_l", "shank_l"]
    assert (knee.first, knee.second, knee.lag_s[0]) == ("thigh_l", "shank_l", 0.02)
    ankle = result["shank_l", "foot_l"]
    assert (ankle.first, ankle.second, ankle.lag_s[0], ankle.turn[0]) == ("shank_l", "foot_l", -0.02, -0.1)
    assert ankle.places[0].tolist() == [3.0, 4.0, 5.0, 0.0, 1.0, 2.0]
    right = result["thigh_r", "shank_r"]
    assert vars(right) == vars(replace(inputs[2]))


def test_a_pair_that_was_not_compared_is_left_out() -> None:
    inputs = windows("thigh_l", "shank_l")
    assert relabel((), {frozenset(("thigh_l", "foot_l")): inputs}) == {}
    assert list(relabel((), {frozenset(("thigh_l", "shank_l")): inputs})) == [("thigh_l", "shank_l")]
