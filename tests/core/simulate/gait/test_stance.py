"""The foot on the floor: which point is held, where the ankle goes over it, and how it leaves."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Floats
from sagittal.core.rotation import rotate
from sagittal.core.simulate.gait.curves import FOOT_PITCH
from sagittal.core.simulate.gait.stance import Q_NEUTRAL, Sole, StanceFoot, foot_orientation
from sagittal.core.simulate.gait.timing import foot_timing
from sagittal.core.simulate.script import Stand, Straight, plan
from sagittal.core.simulate.walker import STEADY, SideGait, Walker

RATE = 200.0
WALKER = Walker(variability=STEADY)
STEP_M = WALKER.reference_step_m
WALK = plan((Stand(1.0), Straight(5 * STEP_M, STEP_M, 0.5), Stand(1.0)), WALKER, np.random.default_rng(0))
T = np.arange(round(WALK.duration_s * RATE) + 1) / RATE
FEET = {s: StanceFoot.of(WALK, WALKER, s, foot_timing(WALK, WALKER, s)) for s in SIDES}
FOOT, SOLE = FEET["left"], Sole.of(WALKER)


def turned(pitch: Floats) -> Floats:
    return foot_orientation(FOOT.prints[1].foot_rad, pitch)


def test_a_foot_is_turned_then_pitched_then_rolled() -> None:
    ahead, up, right = np.eye(3)
    q = foot_orientation(np.pi / 2, np.array([0.3]))[0]
    # heading left of +x is +y; toes up
    assert rotate(q, ahead) == pytest.approx([0.0, np.cos(0.3), np.sin(0.3)])
    assert foot_orientation(0.0, np.zeros(1))[0] == pytest.approx(Q_NEUTRAL)
    rolled = foot_orientation(0.0, np.zeros(1), 0.2)[0]
    assert rotate(rolled, ahead) == pytest.approx([1.0, 0.0, 0.0])
    assert rotate(rolled, up)[2] == pytest.approx(np.cos(0.2))
    assert rotate(rolled, right)[2] == pytest.approx(-np.sin(0.2))


def test_the_sole_is_level_up_to_where_it_begins_to_curve() -> None:
    a = WALKER.anatomy
    assert SOLE.heel.tolist() == [-a.heel, -a.ankle_height, 0.0]
    assert SOLE.forefoot.tolist() == [a.rocker_start, -a.ankle_height, 0.0]
    assert SOLE.rocker_centre - SOLE.forefoot == pytest.approx([0.0, a.rocker_radius, 0.0])
    # the tip is the parabola's height above the floor
    assert SOLE.toe[1] + a.ankle_height == pytest.approx(
        (a.toe - a.rocker_start) ** 2 / (2 * a.rocker_radius)
    )


def test_the_lowest_point_is_the_heel_toes_up_and_the_rolling_forefoot_toes_down() -> None:
    ankle = np.array([[0.0, 0.0, WALKER.anatomy.ankle_height]] * 3)
    pitch = np.array([0.0, 0.3, -0.3])
    low = SOLE.lowest(ankle, turned(pitch), pitch)
    assert low[0] == pytest.approx(0.0, abs=1e-12)
    a = WALKER.anatomy
    assert low[1] == pytest.approx(a.ankle_height - a.heel * np.sin(0.3) - a.ankle_height * np.cos(0.3))
    centre = a.rocker_radius - a.ankle_height
    rolling = a.ankle_height - a.rocker_start * np.sin(0.3) + centre * np.cos(0.3) - a.rocker_radius
    assert low[2] <= rolling + 1e-12


def test_on_its_heel_the_heel_stays_and_on_its_forefoot_it_rolls_without_slip() -> None:
    foot, pitch = FOOT.prints[1], np.linspace(0.0, -0.8, 81)
    flat = np.array([foot.x_m, foot.y_m, WALKER.anatomy.ankle_height])
    up = turned(-pitch)
    heel = FOOT.on_heel(1, up) + rotate(up, SOLE.heel)
    assert np.ptp(heel, axis=0).max() < 1e-12
    assert heel[0, 2] == pytest.approx(0.0, abs=1e-12)
    assert FOOT.on_heel(1, up)[0] == pytest.approx(flat)
    q = turned(pitch)
    ankle = FOOT.on_forefoot(1, q, pitch)
    assert ankle[0] == pytest.approx(flat)
    centre = ankle + rotate(q, SOLE.rocker_centre)
    assert centre[:, 2] == pytest.approx(SOLE.rocker_radius)
    way = np.hypot(*(centre - centre[0])[:, :2].T)
    assert way == pytest.approx(SOLE.rocker_radius * -pitch)
    ahead = centre[-1, :2] - centre[0, :2]
    assert np.arctan2(ahead[1], ahead[0]) == pytest.approx(foot.foot_rad)


def test_a_long_step_lands_toes_up_and_who_points_the_toes_on_the_forefoot() -> None:
    # the second footprint ends a whole step
    assert FOOT.landing_pitch(1) == pytest.approx(SideGait().contact_pitch_rad, rel=1e-6)
    pitch = np.array([0.1])
    q = turned(pitch)
    assert FOOT.on_landing(1, q, pitch).tolist() == FOOT.on_heel(1, q).tolist()
    pointed = Walker(variability=STEADY, sides=dict.fromkeys(SIDES, SideGait(contact_pitch_rad=-0.1)))
    foot = StanceFoot.of(WALK, pointed, "left", FOOT.timing)
    assert foot.landing_pitch(1) == pytest.approx(-0.1)
    assert foot.on_landing(1, q, -pitch).tolist() == foot.on_forefoot(1, q, -pitch).tolist()


def test_the_heel_rises_from_its_time_on_and_is_at_mid_cycle_when_the_other_foot_lands() -> None:
    x, i = FOOT.timing, 1
    times = np.array([x.heel_off[i] - 0.1, x.heel_off[i], x.opposite[i], x.release[i]])
    pitch = FOOT.push_off_pitch(i, times)
    start = float(FOOT_PITCH(np.array(SideGait().heel_off)))
    assert pitch[:2].tolist() == [0.0, 0.0]
    assert pitch[2] == pytest.approx(float(FOOT_PITCH(np.array(0.5))) - start)
    assert pitch[3] == pytest.approx(float(FOOT_PITCH(np.array(0.59))) - start)
    assert 0.0 > pitch[2] > pitch[3]


def test_between_landing_and_heel_off_the_foot_does_not_move_at_all() -> None:
    for side, foot in FEET.items():
        ankle, pitch, heading = foot.path(T)
        for i, footprint in enumerate(WALK.footprints[side]):
            first = foot.timing.flat[i - 1] if i else 0.0
            last = foot.timing.heel_off[i] if i < len(foot.timing.heel_off) else T[-1]
            still = (first <= T) & (last >= T)
            assert still.any()
            assert not pitch[still].any()
            assert np.ptp(ankle[still], axis=0).max() == 0.0
            assert ankle[still][0, :2] == pytest.approx((footprint.x_m, footprint.y_m))
            assert np.unique(heading[still]).tolist() == [footprint.foot_rad]
        contact = np.searchsorted(T, foot.timing.contact[0])
        assert pitch[contact] == pytest.approx(foot.landing_pitch(1), abs=0.02)
