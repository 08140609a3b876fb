"""What walking shows of wrong sensors, on walks whose every number is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.body import BodyModel
from sagittal.core.body.l7s.checks import SeenWalk, longest_gaps, walking_checks
from sagittal.core.body.l7s.filter import L7sInputs, L7sTrack
from sagittal.core.body.l7s.legs import LegModel
from sagittal.core.frames import Floats
from sagittal.core.rotation import about, to_matrix

MODEL = LegModel.of(BodyModel.from_height(1.7))
WIDTH = MODEL.hip_width
RATE = 50.0
STRIDES = 8
N = round(STRIDES * RATE)


def walk(turn_per_s: float = 0.0, *, pelvis: bool = False) -> SeenWalk:
    """A stride a second, feet a hip width apart on a circle; the left one rests for its first 0.4 s."""
    t = np.arange(N) / RATE
    phase = t % 1.0
    step = np.stack((phase < 0.4, (phase >= 0.5) & (phase < 0.9)), axis=1)
    heading = turn_per_s * t
    forward = np.stack((np.cos(heading), np.sin(heading)), axis=1)
    left = np.stack((-np.sin(heading), np.cos(heading)), axis=1)
    if turn_per_s:
        middle = np.stack((np.sin(heading), 1.0 - np.cos(heading)), axis=1) / turn_per_s
    else:
        middle = np.stack((t, np.zeros(N)), axis=1)
    feet = np.stack((middle + 0.5 * WIDTH * left, middle - 0.5 * WIDTH * left), axis=1)
    return SeenWalk(step, forward, feet, np.zeros((N, 3)) if pelvis else None)


def check(observations: SeenWalk) -> dict[str, float]:
    return walking_checks(observations, MODEL, RATE)


def exchanged(observations: SeenWalk) -> SeenWalk:
    return replace(observations, step=observations.step[:, ::-1], feet=observations.feet[:, ::-1])


def test_a_straight_walk_has_its_feet_in_place_and_in_turn() -> None:
    result = check(walk())
    assert result["out_of_place_share"] == 0.0
    assert result["phase_off"] == pytest.approx(0.0, abs=0.02)
    assert result["turned_rad"] == pytest.approx(0.0, abs=1e-9)
    assert "inner_foot_m" not in result


@pytest.mark.parametrize(("widths", "share"), [(1.9, 0.0), (2.1, 1.0), (-0.4, 0.0), (-0.6, 1.0)])
def test_feet_are_out_of_place_beyond_twice_the_hips_or_crossed(widths: float, share: float) -> None:
    observations = walk()
    observations.feet[:, 0, 1], observations.feet[:, 1, 1] = widths * WIDTH, 0.0
    assert check(observations)["out_of_place_share"] == share


def test_only_time_in_motion_counts() -> None:
    observations = walk()
    observations.feet[: N // 2, 0, 1] = 5.0
    observations.step[: N // 4] = True
    assert check(observations)["out_of_place_share"] == pytest.approx(1.0 / 3.0)


def test_a_foot_that_rests_late_or_never_is_out_of_phase() -> None:
    late = walk()
    late.step[:, 1] = np.roll(late.step[:, 1], round(0.3 * RATE))
    assert check(late)["phase_off"] == pytest.approx(0.3, abs=0.02)
    never = walk()
    never.step[:, 1] = False
    assert check(never)["phase_off"] == pytest.approx(0.5)


def test_few_strides_and_slow_ones_say_nothing_of_phases() -> None:
    short = walk()
    short.step[round(2.4 * RATE) :] = False
    assert "phase_off" not in check(short)
    slow = walk()
    slow.step[:] = np.repeat(slow.step[: N // 3 + 1], 3, axis=0)[:N]
    assert "phase_off" not in check(slow)


@pytest.mark.parametrize("turn_per_s", [0.5, -0.5])
def test_the_inner_foot_goes_less_far_by_the_distance_of_the_feet(turn_per_s: float) -> None:
    observations = walk(turn_per_s)
    result = check(observations)
    assert result["inner_foot_m"] == pytest.approx(-WIDTH, rel=0.05)
    assert result["turned_rad"] == pytest.approx(0.5 * np.sqrt(STRIDES - 2), rel=0.15)
    assert check(exchanged(observations))["inner_foot_m"] == pytest.approx(WIDTH, rel=0.05)


def test_too_little_turning_says_nothing_of_sides() -> None:
    result = check(walk(0.3))
    assert 0.0 < result["turned_rad"] < np.radians(60.0)
    assert "inner_foot_m" not in result
    single_walk = walk(0.5)
    single_walk.step[:, 1] = False
    assert not {"turned_rad", "inner_foot_m"} & set(check(single_walk))


def test_the_pelvis_falls_away_from_the_foot_it_stands_on() -> None:
    observations = walk(pelvis=True)
    assert observations.pelvis is not None
    single = observations.step.astype(float)
    observations.pelvis[:, 1] = -0.8 * single[:, 0] + 0.4 * single[:, 1]
    result = check(observations)
    assert result["toward_foot_mps2"] == pytest.approx(-0.6)
    assert not {"turned_rad", "inner_foot_m"} & set(result)
    assert check(exchanged(observations))["toward_foot_mps2"] == pytest.approx(0.6)
    joint_walk = walk(pelvis=True)
    joint_walk.step[:, 1] = False
    assert "toward_foot_mps2" not in check(joint_walk)


def test_rise_and_tilt_of_the_pelvis_are_those_of_its_movement() -> None:
    observations = walk(pelvis=True)
    assert observations.pelvis is not None
    t = np.arange(N) / RATE
    depth, width_s = 0.3, 0.3
    u = (t - 4.0) / width_s
    observations.pelvis[:, 0] = -depth * (u**2 - 1.0) * np.exp(-0.5 * u**2) / width_s**2
    observations.pelvis[:, 2] = 0.1 + 0.02 * np.sin(2.0 * np.pi * t)
    result = check(observations)
    assert result["pelvis_rise_m"] == pytest.approx(depth, rel=0.15)
    assert result["pelvis_tilt_sd_rad"] == pytest.approx(0.02 / np.sqrt(2.0), rel=0.01)


def inputs(turned: Floats, segments: str) -> L7sInputs:
    acc = np.zeros((2, 3, 3))
    acc[:, 0] = (1.0, 2.0, 3.0)
    return L7sInputs(np.broadcast_to(turned, (2, 3, 3, 3)), acc, np.ones((2, 2), np.bool_), segments)  # type: ignore[arg-type]


def test_a_block_is_seen_level_and_in_the_axes_of_the_pelvis() -> None:
    turned = to_matrix(about(2, 0.5 * np.pi)) @ to_matrix(about(1, 0.3))
    p = np.arange(18.0).reshape(2, 3, 3)
    track = L7sTrack(np.zeros((2, 3, 3, 3)), p, p, np.zeros((2, 27)))
    observations = SeenWalk.of(inputs(turned, "3I"), track)
    assert observations.feet.tolist() == p[:, 1:, :2].tolist()
    assert observations.forward == pytest.approx(2.0 * np.broadcast_to(turned[:2, 2], (2, 2)))
    assert observations.pelvis is not None
    # its left is −x of W now, and leaning forward is positive
    assert observations.pelvis[0] == pytest.approx([3.0, -1.0, 0.3])
    assert SeenWalk.of(inputs(turned, "2I"), track).pelvis is None


def test_blocks_are_put_together() -> None:
    whole, take = walk(pelvis=True), SeenWalk.make_room(N, pelvis=True)
    for part in (slice(0, 100), slice(100, N)):
        assert whole.pelvis is not None
        take.put(part, SeenWalk(whole.step[part], whole.forward[part], whole.feet[part], whole.pelvis[part]))
    assert check(take) == check(whole)
    assert SeenWalk.make_room(3, pelvis=False).pelvis is None


def test_gaps_are_measured_in_seconds() -> None:
    mask = np.ones(100, np.bool_)
    lost = mask.copy()
    lost[10:15] = lost[50:75] = False
    assert longest_gaps({"pelvis": mask, "foot_l": lost}, RATE) == {"pelvis": 0.0, "foot_l": 0.5}
