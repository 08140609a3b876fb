"""People who do not walk like the textbook walk as their names say."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.frames import FOOT, SIDES, Side
from sagittal.core.simulate import IMPAIRED_WALKS, SCRIPTS, WalkTruth, simulate_scenario

pytestmark = pytest.mark.slow


@cache
def truth(name: str) -> WalkTruth:
    return simulate_scenario(name, 2).truth


def pitch_range_deg(name: str, side: Side) -> float:
    """How far a foot pitches over the take."""
    q = truth(name).q[FOOT[side]]
    forward = 2.0 * (q[:, 1] * q[:, 3] - q[:, 0] * q[:, 2])
    return float(np.degrees(np.ptp(np.arcsin(forward))))


def test_their_names_are_their_own() -> None:
    assert not set(IMPAIRED_WALKS) & set(SCRIPTS)


@pytest.mark.parametrize("name", sorted(IMPAIRED_WALKS))
def test_every_swing_has_exact_contacts(name: str) -> None:
    for side in SIDES:
        contacts = truth(name).contacts[side]
        assert len(contacts.contact) >= 15
        assert (contacts.release < contacts.contact).all()
        assert (contacts.contact[:-1] < contacts.release[1:]).all()


def test_a_shuffler_takes_short_steps_and_hardly_lifts_the_feet() -> None:
    lengths = [s.length_m for s in truth("shuffler").strides]
    assert 0.26 <= float(np.median(lengths)) <= 0.34
    assert all(pitch_range_deg("shuffler", side) < 12.0 for side in SIDES)


def test_dragged_and_braced_legs_hardly_pitch_the_left_foot_alone() -> None:
    for name in ("dragged_foot", "locked_knee"):
        assert pitch_range_deg(name, "left") < 0.6 * pitch_range_deg(name, "right")
    knee = truth("locked_knee").angles
    swing = slice(*(round(100 * t) for t in (truth("locked_knee").contacts["left"].release[3],
                                             truth("locked_knee").contacts["left"].contact[3])))  # fmt: skip
    assert np.ptp(np.degrees(knee["knee_flexion_l"][swing])) < np.ptp(np.degrees(knee["knee_flexion_r"]))


def test_one_foot_steps_and_the_other_comes_beside_it() -> None:
    prints = truth("step_to").footprints
    steps = {side: float(np.median([f.step_m for f in prints[side][1:]])) for side in SIDES}
    assert steps["right"] < 0.2 * steps["left"]


def test_a_freezer_trembles_where_nobody_steps() -> None:
    take = simulate_scenario("freezer", 2)
    rate = np.linalg.norm(take.ideal["foot_l"].gyr, axis=1)
    freezes = [s for s in take.truth.stands if s[1] - s[0] == pytest.approx(4.0) and s[0] > 0.0][:2]
    assert len(freezes) == 2
    for start, end in freezes:
        assert rate[round(100 * (start + 1.0)) : round(100 * (end - 1.0))].max() > 1.0
        for side in SIDES:
            landed = take.truth.contacts[side].contact
            assert not ((landed > start) & (landed < end)).any()
