"""Footprints and trails: where the feet rested and went, with gaps, without contacts, of one foot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core import rotation
from sagittal.core.body.poses import Poses
from sagittal.core.frames import FOOT, SIDES, Floats
from sagittal.server.viewer.motion import ReplayMotion, prepare_motion
from sagittal.server.viewer.steps import PIECE_M, find_prints, lay_trail
from tests.helpers.walks import simulated
from tests.server import walk

T_S = np.arange(500) / 50.0
FLAT = np.tile([1.0, 0.0, 0.0, 0.0], (500, 1))


def straight(speed: float = 1.0) -> Floats:
    """A path along x."""
    return np.stack((speed * T_S, 0 * T_S, 0 * T_S), axis=1)


def stepping(stride_m: float = 1.2) -> tuple[Floats, np.ndarray]:
    """A foot that rests for a second and swings for a second, five times, and when it is on the floor."""
    phase, count = np.modf(T_S / 2.0)
    swing = np.clip(2 * phase - 1, 0, 1)
    x = stride_m * (count + swing**2 * (3 - 2 * swing))
    return np.stack((x, 0 * x, 0.1 * np.sin(np.pi * swing)), axis=1), phase < 0.5


def without_contact(poses: Poses) -> Poses:
    return replace(poses, contact={})


def test_one_print_lies_under_each_contact_and_appears_during_it() -> None:
    path, contact = stepping()
    prints = find_prints(T_S, np.ones(500, bool), contact, path, FLAT)
    np.testing.assert_allclose(prints.position[:, 0], 1.2 * np.arange(5), atol=1e-5)
    assert np.all((prints.t_s % 2.0) < 1.0)


def test_prints_are_a_stride_apart_on_a_walk(motion: ReplayMotion) -> None:
    for side in SIDES:
        steps = np.diff(motion.prints[side].position[1:-1, 0])
        assert len(steps) >= 8
        np.testing.assert_allclose(steps, 1.2 * walk.STRIDE_S, atol=0.02)


@pytest.mark.parametrize("known", [True, False], ids=["contacts known", "contacts missed"])
@pytest.mark.parametrize("name", ["fast_with_turns", "severe_shuffle"])
def test_prints_are_those_of_the_simulated_walker(name: str, known: bool) -> None:
    _, truth = simulated(name)
    always = np.ones(len(truth.t_s), bool)
    contact = {FOOT[s]: c if known else always for s, c in truth.contact.items()}
    poses = Poses(truth.t_s, truth.rate_hz, truth.q, truth.p, always, contact, truth.body, "erkf_smoothed")
    prints = prepare_motion(poses).prints
    for side in SIDES:
        true = truth.footprints[side]
        heading = np.array([f.foot_rad for f in true])
        assert len(prints[side].t_s) == len(true)
        ahead = 0.25 * truth.body.foot * np.stack((np.cos(heading), np.sin(heading)), axis=1)
        place = np.array([(f.x_m, f.y_m) for f in true]) + ahead
        np.testing.assert_allclose(prints[side].position[:, :2], place, atol=0.01)
        turned = rotation.yaw(prints[side].wxyz.astype(float)) - heading
        np.testing.assert_allclose(np.angle(np.exp(1j * turned)), 0, atol=np.radians(1))


def test_a_print_lies_flat_and_points_where_the_toes_point() -> None:
    path, contact = stepping()
    turned = rotation.multiply(rotation.about(2, np.radians(30)), rotation.about(1, np.radians(-12)))
    prints = find_prints(T_S, np.ones(500, bool), contact, path, np.tile(turned, (500, 1)))
    np.testing.assert_allclose(np.degrees(rotation.yaw(prints.wxyz.astype(float))), 30, atol=1e-4)
    up = rotation.rotate(prints.wxyz.astype(float), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(up, [[0, 0, 1]] * 5, atol=1e-6)
    assert np.ptp(prints.position[:, 2]) == 0


def test_a_restless_standing_foot_leaves_one_print() -> None:
    wobble = np.stack((0.004 * np.sin(9 * T_S), 0 * T_S, 0 * T_S), axis=1)
    prints = find_prints(T_S, np.ones(500, bool), np.sin(20 * T_S) > 0, wobble, FLAT)
    assert len(prints.t_s) == 1


def test_a_step_that_the_contacts_miss_leaves_its_print() -> None:
    path, contact = stepping()
    missed = contact | ((T_S > 2.9) & (T_S < 4.1))
    prints = find_prints(T_S, np.ones(500, bool), missed, path, FLAT)
    np.testing.assert_allclose(prints.position[:, 0], 1.2 * np.arange(5), atol=1e-5)


def test_a_foot_that_slides_through_its_contact_leaves_a_print_all_the_same() -> None:
    prints = find_prints(T_S, np.ones(500, bool), (T_S > 3) & (T_S < 4), straight(0.5), FLAT)
    assert len(prints.t_s) == 1
    assert 3 < prints.t_s[0] < 4


def test_a_foot_that_never_rests_leaves_no_print() -> None:
    prints = find_prints(T_S, np.ones(500, bool), np.zeros(500, bool), straight(), FLAT)
    assert prints.position.shape == (0, 3)
    assert prints.wxyz.shape == (0, 4)


def test_no_print_comes_from_samples_that_were_lost() -> None:
    path, contact = stepping()
    prints = find_prints(T_S, (T_S < 3.9) | (T_S > 5.2), contact, path, FLAT)
    np.testing.assert_allclose(prints.position[:, 0], 1.2 * np.array([0, 1, 3, 4]), atol=1e-5)


def test_a_trail_is_one_line_in_short_pieces() -> None:
    result = lay_trail(T_S, np.ones(500, bool), straight())
    length = np.linalg.norm(result.pieces[:, 1] - result.pieces[:, 0], axis=1)
    assert length.max() < PIECE_M + 0.021  # a sample's way more at most
    np.testing.assert_allclose(length.sum(), straight()[-1, 0], rtol=1e-5)
    np.testing.assert_array_equal(result.pieces[1:, 0], result.pieces[:-1, 1])
    assert np.all(np.diff(result.t_s) > 0)


def test_a_trail_ends_where_the_foot_is(motion: ReplayMotion) -> None:
    for side in SIDES:
        trails = motion.trails[side]
        for t_s in (2.0, 5.5, 9.0):
            last = trails.pieces[np.searchsorted(trails.t_s, t_s, side="right") - 1, 1]
            foot = motion.batches["foot_l" if side == "left" else "foot_r"]
            ankle = foot.position[motion.index(t_s), 0]
            assert np.hypot(*(last - ankle)[:2]) < 0.25 * walk.BODY.foot + PIECE_M + 0.1


def test_a_standing_foot_adds_nothing_to_its_trail() -> None:
    assert len(lay_trail(T_S, np.ones(500, bool), straight(0.0)).t_s) <= 1


def test_a_trail_has_a_gap_where_samples_were_lost() -> None:
    valid = (T_S < 4.0) | (T_S >= 6.0)
    path = straight()
    path[~valid] = path[199]
    result = lay_trail(T_S, valid, path)
    assert result.pieces[..., 0].max() > 9.9
    inside = (result.pieces[..., 0] > 3.99) & (result.pieces[..., 0] < 5.99)
    assert not inside.any()
    assert np.all(np.linalg.norm(result.pieces[:, 1] - result.pieces[:, 0], axis=1) < 0.1)


def test_a_trail_of_nothing_valid_is_empty() -> None:
    assert lay_trail(T_S, np.zeros(500, bool), straight()).pieces.shape == (0, 2, 3)


def test_a_take_without_contacts_has_trails_and_no_prints() -> None:
    result = prepare_motion(without_contact(walk.poses(3.0)))
    assert result.prints == {}
    assert set(result.trails) == {"left", "right"}


def test_one_foot_leaves_its_own_prints_and_trail_only() -> None:
    poses = walk.poses(5.0)
    one = replace(
        poses,
        q={"foot_r": poses.q["foot_r"]},
        p={"foot_r": poses.p["foot_r"]},
        contact={"foot_r": poses.contact[FOOT["right"]]},
    )
    result = prepare_motion(one)
    assert set(result.prints) == set(result.trails) == {"right"}
    assert len(result.prints["right"].t_s) >= 4
