"""Legs followed as one body: choice of the pelvis, and lifted feet."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body.chain.figure import HAND_OVER_S, draw_legs, join_legs
from sagittal.core.body.chain.leg import LegMotion
from sagittal.core.frames import FOOT, R_NEUTRAL, SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, from_matrix, multiply

RATE = 50.0
N = 200
NEUTRAL = from_matrix(R_NEUTRAL)


def leg(side: Side, stands: Bools, turned_deg: float = 0.0, known: Bools | None = None) -> LegMotion:
    """A straight leg whose pelvis, and nothing else, is turned about the vertical."""
    q: dict[Segment, Floats] = {
        s: np.tile(NEUTRAL, (N, 1)) for s in ("pelvis", THIGH[side], SHANK[side], FOOT[side])
    }
    q["pelvis"] = np.tile(multiply(about(2, np.radians(turned_deg)), NEUTRAL), (N, 1))
    target = np.ones(N, np.bool_) if known is None else known
    orientations = Orientations(np.arange(N) / RATE, RATE, q, dict.fromkeys(q, target), "chain")
    return LegMotion(side, orientations, None, None, 0, stands)  # type: ignore[arg-type]


def turn_of(q: Floats) -> Floats:
    """Degrees about the vertical from neutral."""
    d = multiply(q, NEUTRAL * [1.0, -1.0, -1.0, -1.0])
    return np.asarray(np.degrees(2.0 * np.arctan2(d[:, 3], d[:, 0])))


FIRST = np.arange(N) < N // 2
ALWAYS = np.ones(N, np.bool_)


def test_one_leg_is_its_own_body() -> None:
    single = leg("left", ALWAYS)
    assert join_legs({"left": single}) is single.orientations


def test_the_pelvis_is_that_of_the_leg_that_stands() -> None:
    joined = join_legs({"left": leg("left", FIRST, 0.0), "right": leg("right", ~FIRST, 10.0)})
    assert set(joined.q) == {"pelvis", *(x[s] for s in SIDES for x in (THIGH, SHANK, FOOT))}
    turn = turn_of(joined.q["pelvis"])
    half = round(0.5 * HAND_OVER_S * RATE)
    assert turn[: N // 2 - half - 1] == pytest.approx(0.0)
    assert turn[N // 2 + half + 1 :] == pytest.approx(10.0)
    gap = turn[N // 2 - half : N // 2 + half]
    assert np.diff(gap).min() > 0.0
    assert np.linalg.norm(joined.q["pelvis"], axis=1) == pytest.approx(1.0)
    assert joined.valid["pelvis"].all()


def test_on_both_legs_it_is_the_mean_whatever_half_of_the_sphere_they_use() -> None:
    left, right = leg("left", ALWAYS, 0.0), leg("right", ALWAYS, 10.0)
    right.orientations.q["pelvis"][:] *= -1.0
    assert turn_of(join_legs({"left": left, "right": right}).q["pelvis"]) == pytest.approx(5.0)


def test_a_leg_whose_pelvis_is_not_known_has_no_say() -> None:
    left = leg("left", ALWAYS, 0.0, known=FIRST)
    right = leg("right", ALWAYS, 10.0, known=np.arange(N) < 150)
    joined = join_legs({"left": left, "right": right})
    turn = turn_of(joined.q["pelvis"])
    assert turn[FIRST] == pytest.approx(5.0)
    assert turn[100:150] == pytest.approx(10.0)
    assert joined.valid["pelvis"].tolist() == [True] * 150 + [False] * 50


def test_a_lifted_foot_hangs_square_on_its_shin() -> None:
    left, right = leg("left", ALWAYS), leg("right", FIRST)
    bent = multiply(about(1, 0.5), NEUTRAL)
    right.orientations.q["shank_r"][:] = bent
    drawn = draw_legs({"left": left, "right": right}, 1.7)
    foot = drawn.poses.q["foot_r"]
    assert foot[FIRST] == pytest.approx(np.tile(NEUTRAL, (N // 2, 1)), abs=1e-6)
    assert np.abs((foot[~FIRST] * bent).sum(axis=1)) == pytest.approx(1.0)
    assert set(drawn.poses.diagnostics["sensors"]) == {  # type: ignore[call-overload]
        "pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r",
    }  # fmt: skip
    assert drawn.orientations.q["foot_r"][-1] == pytest.approx(NEUTRAL), "what was measured stays"
