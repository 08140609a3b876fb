"""The foot in the air: joined to both contacts, clear of the floor, within the leg's reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import SIDES
from sagittal.core.rotation import rotate
from sagittal.core.simulate.gait.human import Motion, move
from sagittal.core.simulate.gait.pelvis import hip_offset
from sagittal.core.simulate.gait.stance import StanceFoot, foot_orientation
from sagittal.core.simulate.gait.swing import MOST_LIFT, ROLL, FootMotion, foot_motion
from sagittal.core.simulate.script import Stand, Straight, plan
from sagittal.core.simulate.shapes import bump
from sagittal.core.simulate.walker import STEADY, SideGait, Walker, leg_reach

RATE = 200.0
WALKER = Walker(variability=STEADY)


def walk(walker: Walker, rate_hz: float = RATE) -> Motion:
    step_m = walker.reference_step_m
    script = (Stand(1.0), Straight(4 * step_m, step_m, 0.54), Stand(1.0))
    return move(plan(script, walker, np.random.default_rng(0)), walker, rate_hz)


def swing(motion: Motion, lower_m: float = 0.0) -> tuple[StanceFoot, FootMotion]:
    """The left foot under the pelvis of a motion."""
    stance = StanceFoot.of(motion.plan, motion.walker, "left", motion.timings["left"])
    mid_hip = motion.p["pelvis"] - [0.0, 0.0, lower_m]
    return stance, foot_motion(motion.t_s, stance, stance.path(motion.t_s), mid_hip, motion.q["pelvis"])


MOTION = walk(WALKER)
STANCE, FOUND = swing(MOTION)
IN_AIR = np.zeros(len(MOTION.t_s), np.bool_)
for release, contact in zip(STANCE.timing.release, STANCE.timing.contact, strict=True):
    IN_AIR |= (MOTION.t_s > release) & (MOTION.t_s < contact)


def test_on_the_floor_the_foot_is_where_stance_has_it() -> None:
    ankle, pitch, heading = STANCE.path(MOTION.t_s)
    assert np.array_equal(FOUND.pitch[~IN_AIR], pitch[~IN_AIR])
    assert np.array_equal(FOUND.heading[~IN_AIR], heading[~IN_AIR])
    assert FOUND.ankle[~IN_AIR] == pytest.approx(ankle[~IN_AIR], abs=1e-9)
    assert FOUND.roll[~IN_AIR] == pytest.approx(0.0, abs=1e-9)


def test_it_leaves_and_lands_without_a_jump_of_its_speed() -> None:
    """Velocity changes per sample halve on a grid twice as fine."""
    _, fine = swing(walk(WALKER, 2.0 * RATE))
    for coarse_x, fine_x in ((FOUND.ankle, fine.ankle), (FOUND.pitch, fine.pitch), (FOUND.roll, fine.roll)):
        change, half = (
            rate * np.abs(np.diff(x, 2, axis=0)).max() for x, rate in ((coarse_x, RATE), (fine_x, 2.0 * RATE))
        )
        assert half < 0.6 * change


def test_the_free_foot_is_supinated_and_turns_to_the_path_it_lands_on() -> None:
    assert FOUND.roll.min() == pytest.approx(-ROLL, rel=0.01)
    assert FOUND.roll.max() == pytest.approx(0.0, abs=1e-12)
    right = foot_motion(
        MOTION.t_s,
        StanceFoot.of(MOTION.plan, WALKER, "right", MOTION.timings["right"]),
        StanceFoot.of(MOTION.plan, WALKER, "right", MOTION.timings["right"]).path(MOTION.t_s),
        MOTION.p["pelvis"],
        MOTION.q["pelvis"],
    )
    assert right.roll.max() == pytest.approx(ROLL, rel=0.01)


def test_the_sole_clears_the_floor_in_mid_swing() -> None:
    q = foot_orientation(FOUND.heading, FOUND.pitch, FOUND.roll)
    low = STANCE.sole.lowest(FOUND.ankle, q, FOUND.pitch)
    for release, contact in zip(STANCE.timing.release, STANCE.timing.contact, strict=True):
        u = (MOTION.t_s - release) / (contact - release)
        assert low[(u > 0.3) & (u < 0.7)].min() > SideGait().clearance_m - 0.001
    assert len(FOUND.lifts) == len(STANCE.timing.contact)
    assert min(FOUND.lifts) >= 0.0


def test_the_free_leg_is_kept_from_straightening() -> None:
    """Limits the swing leg where its targets would be too long, with a higher pelvis."""
    limit = float(leg_reach(WALKER.anatomy, SideGait().knee_min_rad + np.radians(1.0)))
    _, high = swing(MOTION, -0.04)
    hip = MOTION.p["pelvis"] + [0.0, 0.0, 0.04] + rotate(MOTION.q["pelvis"], hip_offset(WALKER, "left"))
    length = np.linalg.norm(high.ankle - hip, axis=1)
    for release, contact in zip(STANCE.timing.release, STANCE.timing.contact, strict=True):
        u = (MOTION.t_s - release) / (contact - release)
        assert length[(u > 0.2) & (u < 0.9)].max() <= limit
    assert length.max() > limit


@pytest.mark.parametrize("clearance_m", [0.025, 0.03])
def test_who_lifts_the_foot_clears_the_floor_by_so_much(clearance_m: float) -> None:
    stance, result = swing(
        walk(replace(WALKER, sides=dict.fromkeys(SIDES, SideGait(clearance_m=clearance_m))))
    )
    low = stance.sole.lowest(
        result.ankle, foot_orientation(result.heading, result.pitch, result.roll), result.pitch
    )
    release, contact = stance.timing.release[0], stance.timing.contact[0]
    u = (MOTION.t_s - release) / (contact - release)
    middle = (u > 0.25) & (u < 0.77)
    spare = low[middle] - clearance_m * np.minimum(1.0, 3.0 * bump(u[middle]))
    assert -1e-9 <= spare.min() < 0.01
    assert result.lifts[0] > FOUND.lifts[0] + 0.5 * (clearance_m - SideGait().clearance_m)


def test_no_foot_is_lifted_by_more_than_a_tenth_of_the_leg() -> None:
    _, result = swing(walk(replace(WALKER, sides=dict.fromkeys(SIDES, SideGait(clearance_m=0.5)))))
    most = MOST_LIFT * (WALKER.anatomy.thigh + WALKER.anatomy.shank)
    assert result.lifts == pytest.approx((most, most))


def test_who_does_not_land_rising_pitches_up_before() -> None:
    _, second = swing(walk(replace(WALKER, lands_rising=False)))
    i = 1
    last = (MOTION.t_s > STANCE.timing.contact[i] - 0.12) & (MOTION.t_s < STANCE.timing.contact[i])
    assert (np.diff(FOUND.pitch[last]) > 0.0).all()
    assert (np.diff(second.pitch[last]) < 0.0).any()
