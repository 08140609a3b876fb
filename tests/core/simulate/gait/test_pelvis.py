"""The pelvis over two feet: which leg carries it, how high it is, and what lowers it."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.rotation import rotate
from sagittal.core.simulate.gait.curves import PELVIS_TILT
from sagittal.core.simulate.gait.pelvis import (
    compute_pelvis_height,
    floor_path,
    guard,
    hip_offset,
    load_share,
    orient_pelvis,
)
from sagittal.core.simulate.gait.timing import amplitude, body_phase, foot_timing
from sagittal.core.simulate.script import Stand, Straight, plan
from sagittal.core.simulate.walker import STEADY, SideGait, Walker, leg_reach

RATE = 100.0
WALKER = Walker(variability=STEADY)
STEP_M = WALKER.reference_step_m
WALK = plan((Stand(2.0), Straight(6 * STEP_M, STEP_M, 0.5), Stand(2.0)), WALKER, np.random.default_rng(0))
T = np.arange(round(WALK.duration_s * RATE) + 1) / RATE
TIMINGS = {s: foot_timing(WALK, WALKER, s) for s in SIDES}
ZERO = np.zeros(3)
UPRIGHT = orient_pelvis(WALKER, ZERO, ZERO, dict.fromkeys(SIDES, ZERO), ZERO)


def beside(apart_m: float) -> dict[Side, Floats]:
    """Ankles (3, 3) on both sides of the origin."""
    height = WALKER.anatomy.ankle_height
    left, right = (np.tile([0.0, y, height], (3, 1)) for y in (apart_m, -apart_m))
    return {"left": left, "right": right}


def test_the_hips_are_half_a_width_to_either_side() -> None:
    assert hip_offset(WALKER, "right").tolist() == [0.0, 0.0, 0.5 * WALKER.anatomy.hip_width]
    assert hip_offset(WALKER, "left").tolist() == [0.0, 0.0, -0.5 * WALKER.anatomy.hip_width]
    # the right of somebody who looks along +x is -y
    assert rotate(UPRIGHT[0], hip_offset(WALKER, "right"))[1] == pytest.approx(
        -0.5 * WALKER.anatomy.hip_width
    )


def test_weight_is_on_both_feet_in_standing_and_on_the_other_one_in_swing() -> None:
    shares = {s: load_share(T, WALK, TIMINGS, s) for s in SIDES}
    assert shares["left"] + shares["right"] == pytest.approx(1.0)
    for side, share in shares.items():
        assert share.min() >= -1e-12
        assert share[T < 1.7] == pytest.approx(0.5)
        assert share[-1] == pytest.approx(0.5)
        x = TIMINGS[side]
        assert np.interp(0.5 * (x.release + x.contact), T, share) == pytest.approx(0.0, abs=1e-9)
        second = TIMINGS["left" if side == "right" else "right"]
        assert np.interp(0.5 * (second.release + second.contact), T, share) == pytest.approx(1.0)
        assert np.interp(x.release, T, share) == pytest.approx(0.0, abs=0.02)


def test_it_stands_between_the_feet_and_walks_ahead_of_their_middle() -> None:
    phase, a = body_phase(T, WALK, RATE), amplitude(T, WALK, WALKER, RATE)
    xy, heading = floor_path(T, WALK, WALKER, phase, a, RATE)
    assert xy[T < 1.0] == pytest.approx(0.0, abs=1e-9)
    assert heading == pytest.approx(0.0, abs=1e-12)
    last = [WALK.footprints[s][-1] for s in SIDES]
    assert xy[-1] == pytest.approx([np.mean([f.x_m for f in last]), 0.0], abs=1e-3)
    steps = WALK.steps[2:5]
    for initial, step in zip(WALK.steps[1:4], steps, strict=True):
        middle = 0.5 * (initial.x_m + step.x_m)
        assert np.interp(step.time_s, T, xy[:, 0]) - middle == pytest.approx(WALKER.forward_m, abs=0.01)
        # over the stance foot halfway through the step
        side = np.interp(step.time_s - 0.25, T, xy[:, 1])
        assert 0.0 < side / initial.y_m < WALKER.lateral


def test_without_amplitude_it_is_only_tilted_and_a_hike_lifts_its_own_side() -> None:
    ahead, right = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    down = rotate(UPRIGHT[0], ahead)
    assert np.arctan2(-down[2], down[0]) == pytest.approx(PELVIS_TILT.mean)
    assert rotate(UPRIGHT[0], right) == pytest.approx([0.0, -1.0, 0.0])
    turned = orient_pelvis(WALKER, ZERO + np.pi / 2, ZERO, dict.fromkeys(SIDES, ZERO), ZERO)
    assert rotate(turned[0], right) == pytest.approx([1.0, 0.0, 0.0])
    in_swing = dict.fromkeys(SIDES, ZERO + 0.8)
    for side, up in (("right", 1.0), ("left", -1.0)):
        hiked = Walker(sides={s: SideGait(hike_rad=0.1 * (s == side)) for s in SIDES})
        lifted, flat = (
            rotate(orient_pelvis(w, ZERO, ZERO, in_swing, ZERO + 1.0)[0], right)[2] for w in (hiked, WALKER)
        )
        assert lifted - flat == pytest.approx(up * 0.1, abs=0.01)


def test_standing_it_is_as_high_as_slightly_bent_knees_hold_it() -> None:
    apart = 0.5 * WALKER.anatomy.hip_width + 0.1
    height = compute_pelvis_height(
        WALK,
        WALKER,
        dict.fromkeys(SIDES, ZERO),
        ZERO,
        dict.fromkeys(SIDES, ZERO + 0.5),
        np.zeros((3, 2)),
        UPRIGHT,
        beside(apart),
        RATE,
    )
    reach = float(leg_reach(WALKER.anatomy, WALKER.standing_knee_rad))
    expected = WALKER.anatomy.ankle_height + np.sqrt(reach**2 - 0.1**2)
    # the corner of the least flexion is rounded
    assert height == pytest.approx(expected, abs=0.002)


def test_it_is_lowered_where_a_leg_would_be_too_short_and_only_there() -> None:
    n = 200
    q, xy = np.tile(UPRIGHT[0], (n, 1)), np.zeros((n, 2))
    ankles = {s: np.tile(x[0], (n, 1)) for s, x in beside(0.5 * WALKER.anatomy.hip_width).items()}
    least = WALKER.sides["left"].knee_min_rad - np.radians(0.5)
    highest = WALKER.anatomy.ankle_height + float(leg_reach(WALKER.anatomy, least))
    z = np.full(n, highest - 0.001)
    everywhere = dict.fromkeys(SIDES, np.ones(n, np.bool_))
    same, none = guard(z, WALKER, xy, q, ankles, everywhere, RATE)
    assert same is z
    assert none == 0.0
    z[100] += 0.011
    lower, worst = guard(z, WALKER, xy, q, ankles, everywhere, RATE)
    assert worst == pytest.approx(0.010)
    assert lower[100] == pytest.approx(highest)
    assert (lower <= z + 1e-12).all()
    assert np.array_equal(lower[:80], z[:80])
    nowhere = dict.fromkeys(SIDES, np.zeros(n, np.bool_))
    assert guard(z, WALKER, xy, q, ankles, nowhere, RATE)[1] == 0.0
