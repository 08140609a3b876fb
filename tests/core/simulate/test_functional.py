"""Leg swings and bows: amplitude, direction, and still segments."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from sagittal.core.errors import ParameterError
from sagittal.core.frames import FOOT, SHANK, THIGH
from sagittal.core.rotation import rotate
from sagittal.core.simulate.functional import FunctionalTruth, SwingsAndBows, simulate_swings_and_bows

SHORT = SwingsAndBows(swings=2, bows=1, sides=("left", "right"), lead_s=1.0, rest_s=0.5)
HEIGHT_M = 1.8


@cache
def truth() -> FunctionalTruth:
    return simulate_swings_and_bows(SHORT, HEIGHT_M, seed=3).truth


def part(kind: str) -> NDArray[np.intp]:
    """Samples of one run, without those in which it grows and fades."""
    (phase,) = (p for p in truth().phases if p.kind == kind)
    t = truth().t_s
    return np.flatnonzero((t > phase.start_s + 0.6) & (t < phase.end_s - 0.6))


def test_runs_follow_each_other_with_standing_between() -> None:
    result = [(p.kind, p.start_s, p.end_s) for p in truth().phases]
    assert result == [
        ("stand", 0.0, 1.0),
        ("swing_left", 1.0, 5.0),
        ("stand", 5.0, 5.5),
        ("swing_right", 5.5, 9.5),
        ("stand", 9.5, 10.0),
        ("bow", 10.0, 14.0),
        ("stand", 14.0, 14.5),
    ]
    assert truth().t_s[-1] == pytest.approx(14.5)


def test_what_is_left_out_takes_no_time() -> None:
    for does, kinds in (
        (SwingsAndBows(swings=0, bows=1, bow_s=1.0, lead_s=0.5, rest_s=0.5), ["stand", "bow", "stand"]),
        (SwingsAndBows(swings=0, bows=0, lead_s=0.5), ["stand"]),
    ):
        swings_and_bows = simulate_swings_and_bows(does)
        assert [p.kind for p in swings_and_bows.truth.phases] == kinds
        assert swings_and_bows.truth.t_s[-1] == pytest.approx(swings_and_bows.truth.phases[-1].end_s)


def test_a_leg_swings_from_back_to_front_and_the_other_one_is_still() -> None:
    for side, second in (("left", "right"), ("right", "left")):
        place, angles = part(f"swing_{side}"), {n: np.degrees(a) for n, a in truth().angles.items()}
        hip, knee = (angles[f"{name}_{side[0]}"][place] for name in ("hip_flexion", "knee_flexion"))
        assert hip.max() == pytest.approx(35.0, abs=0.2)
        assert hip.min() == pytest.approx(-10.0, abs=0.2)
        assert knee == pytest.approx(6.0)
        assert np.abs(angles[f"hip_adduction_{side[0]}"][place]).max() == pytest.approx(2.0, abs=0.5)
        for name in ("hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion"):
            assert angles[f"{name}_{second[0]}"][place] == pytest.approx(0.0, abs=1e-9), name


def test_a_bow_goes_forward_and_the_legs_stand() -> None:
    place = part("bow")
    ahead = rotate(truth().q["pelvis"][place], np.array([1.0, 0.0, 0.0]))
    down = np.degrees(np.arcsin(-ahead[:, 2]))
    assert down.max() == pytest.approx(45.0, abs=0.5)
    assert down.min() > 0.0
    assert np.ptp(truth().q["thigh_l"][place], axis=0).max() < 1e-12
    standing = truth().t_s < 1.0
    assert np.ptp(truth().q["pelvis"][standing], axis=0).max() < 1e-12


def test_the_joints_close_over_feet_that_a_person_of_this_height_has() -> None:
    x = truth()
    for side in ("left", "right"):
        thigh = np.linalg.norm(x.p[SHANK[side]] - x.p[THIGH[side]], axis=1)
        assert np.ptp(thigh) < 1e-12
        assert thigh[0] == pytest.approx(0.42 * HEIGHT_M / 1.745)
        assert x.p[FOOT[side]][0, 2] == pytest.approx(0.085 * HEIGHT_M / 1.745)
    assert x.p[THIGH["left"]][0, 1] == pytest.approx(0.085 * HEIGHT_M / 1.745)
    assert x.p[THIGH["right"]][0, 1] == pytest.approx(-0.085 * HEIGHT_M / 1.745)


@pytest.mark.parametrize(
    "wrong", [{"swings": -1}, {"bows": -1}, {"swing_s": 0.0}, {"bow_s": float("nan")}, {"rest_s": -1.0}]
)
def test_what_nobody_can_do_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ParameterError) as caught:
        SwingsAndBows(**wrong)  # type: ignore[arg-type]
    assert caught.value.code == "functional_times"
