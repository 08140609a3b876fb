"""Clearance of heel and toe: hand-made swings, and simulated feet against their own soles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.body.feet import FootTracks
from sagittal.core.body.kinematics import nominal_body
from sagittal.core.body.model import BodyModel
from sagittal.core.frames import FOOT, R_NEUTRAL, SIDES, Floats, Side
from sagittal.core.parameters.clearance import (
    SoleHeights,
    lay_out,
    measure_floor_heights,
    sole_heights,
    toe_clearance,
)
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.rotation import about, from_matrix, multiply, rotate
from sagittal.core.simulate import simulate_scenario
from sagittal.core.subject.shoe import Shoe
from tests.helpers.true_walks import true_tracks

ANKLE = 0.08
BODY = replace(
    BodyModel.from_height(1.7), ankle_height=ANKLE, sole_back=0.06, sole_front=0.19, sole_tip_up=0.01
)


def tipped(*pitch_deg: float) -> FootTracks:
    """A left foot pitched in turn by these angles, its ankle .3 m up."""
    q = multiply(
        about(2, np.full(len(pitch_deg), 0.7)),
        multiply(about(1, -np.radians(pitch_deg)), from_matrix(R_NEUTRAL)),
    )
    n = len(pitch_deg)
    p = np.tile([1.0, 2.0, 0.3], (n, 1))
    ok: dict[Side, np.ndarray] = {"left": np.ones(n, np.bool_)}
    return FootTracks(np.arange(n) / 100, 100.0, {"left": p}, {"left": q}, ok, ok, False, "truth", BODY)


def test_heights_of_the_ends_are_those_of_the_turned_foot() -> None:
    tracks = tipped(0.0, 30.0, -40.0)
    found = sole_heights(tracks, "left")
    assert found is not None
    heel, tip = np.array([-0.06, -ANKLE, 0.0]), np.array([0.19, 0.01 - ANKLE, 0.0])
    assert found.heel == pytest.approx(0.3 + rotate(tracks.q["left"], heel)[:, 2])
    assert found.toe == pytest.approx(0.3 + rotate(tracks.q["left"], tip)[:, 2])
    assert found.toe[0] == pytest.approx(0.3 - ANKLE + 0.01)
    assert found.toe[1] > found.toe[0] > found.toe[2]


def test_without_a_shoe_there_are_no_ends_of_the_sole() -> None:
    assert sole_heights(replace(tipped(0.0, 10.0), body=BodyModel.from_height(1.7)), "left") is None


def swing(heights: Floats, climb: float = 0.0) -> SoleHeights:
    """A toe that starts and ends on the floor; the floor climbs by so much over the stride."""
    slope = climb * np.linspace(0.0, 1.0, len(heights))
    return SoleHeights(ANKLE + slope, heights + slope, heights + slope)


def dip(depth: float = 0.02) -> Floats:
    """Up to 6 cm, down to `depth`, up to 10 cm, down."""
    return np.interp(np.arange(101), [0, 20, 50, 85, 100], [0.0, 0.06, depth, 0.10, 0.0])


@pytest.mark.parametrize("climb", [0.0, 0.05, -0.08])
def test_the_least_height_in_mid_swing_is_told_whatever_the_drift(climb: float) -> None:
    found = swing(dip(), climb)
    heel, tip = measure_floor_heights(found, lay_out(np.array([0]), np.array([100])), ANKLE)
    assert toe_clearance(tip[5:98]) == pytest.approx(0.02)
    assert heel.max() == pytest.approx(0.10)


def test_a_toe_that_scuffs_has_a_negative_clearance_and_not_zero() -> None:
    assert toe_clearance(dip(-0.005)[5:98]) == pytest.approx(-0.005)


def test_a_swing_without_a_dip_has_no_least_height() -> None:
    rising = np.interp(np.arange(101), [0, 60, 100], [0.0, 0.12, 0.0])
    assert toe_clearance(rising[5:98]) == "no_swing_minimum"
    assert toe_clearance(dip()[99:100]) == "no_swing_minimum"


def test_the_shoe_reaches_the_feet() -> None:
    """The tape starts at the sensor, the body model at the ankle 7 cm behind its nominal place."""
    body, _ = nominal_body(1.7, 0.2, Shoe(0.12, 0.14, 0.015))
    assert (body.sole_back, body.sole_front, body.sole_tip_up) == pytest.approx((0.05, 0.21, 0.015))
    assert (body.standing_width, body.estimated) == (0.2, True)
    assert nominal_body(1.7)[0].sole_front is None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comfortable", "drop_foot"])
def test_simulated_toes_pass_the_floor_as_their_soles_do(name: str) -> None:
    """The tip stands off the floor by the sole's rocker; its dip is compared with the path of the tip."""
    truth = simulate_scenario(name, 5).truth
    tracks = true_tracks(truth)
    assert tracks.feet is not None
    tip_up = 0.02
    body = replace(tracks.feet.body, sole_back=0.055, sole_front=0.18, sole_tip_up=tip_up)
    measured = measure_gait(replace(tracks, feet=replace(tracks.feet, body=body)))
    tip = np.array([0.18, tip_up - body.ankle_height, 0.0])
    height = {s: (truth.p[FOOT[s]] + rotate(truth.q[FOOT[s]], tip))[:, 2] for s in SIDES}
    found = list(zip(measured.strides.strides, measured.columns["min_toe_clearance_m"], strict=True))
    assert sum(v is not None for _, v in found) >= 0.8 * len(found)
    for s, value in found:
        if value is None or s.tc_s is None:
            continue
        part = height[s.side][(truth.t_s >= s.tc_s) & (truth.t_s <= s.end_s)]
        third = len(part) // 5
        # every dip lies in the middle of the swing, away from where the tip leaves and lands
        assert value == pytest.approx(part[third:-third].min(), abs=0.004)
    assert {p.unit for p in measured.parameters if p.name == "min_toe_clearance_m"} == {"m"}
