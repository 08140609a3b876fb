from __future__ import annotations

from math import radians

import numpy as np
import pytest

from sagittal.core.frames import Segment
from sagittal.core.rotation import angle_between
from sagittal.core.simulate import RecordingSetup, SoftTissue, Stand, Straight, simulate
from sagittal.core.simulate.gait.human import Motion
from sagittal.core.simulate.gait.soft_tissue import skin_motion

STIFF = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("segment", ["pelvis", "foot_l", "foot_r"])
def test_pelvis_and_feet_are_stiff(steady_motion: Motion, segment: Segment) -> None:
    assert skin_motion(steady_motion.q, segment, SoftTissue()) is None


@pytest.mark.parametrize(("segment", "least", "most"), [("thigh_r", 1.5, 4.0), ("shank_l", 0.9, 2.4)])
def test_skin_is_at_rest_in_standing_and_moves_in_walking(
    steady_motion: Motion, segment: Segment, least: float, most: float
) -> None:
    moved = skin_motion(steady_motion.q, segment, SoftTissue())
    assert moved is not None
    turn, shift = np.degrees(angle_between(moved[0], STIFF)), np.linalg.norm(moved[1], axis=1)
    standing = steady_motion.t_s < 3.0
    assert turn[standing].max() < 1e-6
    assert shift[standing].max() < 1e-9
    assert least < turn.max() < most
    assert 0.005 < shift.max() < 0.015


def test_left_and_right_are_mirror_images(steady_motion: Motion) -> None:
    left, right = (skin_motion(steady_motion.q, s, SoftTissue()) for s in ("thigh_l", "thigh_r"))
    assert left is not None
    assert right is not None
    # half a stride apart: compare what each goes through in the middle of the walk
    middle = (steady_motion.t_s > 9.0) & (steady_motion.t_s < 20.0)
    for k, sign in ((1, -1.0), (2, -1.0), (3, 1.0)):
        a, b = left[0][middle, k], sign * right[0][middle, k]
        assert np.percentile(a, [5, 50, 95]) == pytest.approx(np.percentile(b, [5, 50, 95]), abs=1e-3)


def test_bones_do_not_know_about_skin() -> None:
    script = (Stand(2.0), Straight(2.5, 0.62, 0.54), Stand(2.0))
    bone = simulate(script, seed=1, setup=RecordingSetup(noise=None))
    skin = simulate(
        script, seed=1, setup=RecordingSetup(noise=None, tissue=SoftTissue(turn_rad=radians(6.0)))
    )
    for segment, q in bone.truth.q.items():
        assert np.array_equal(q, skin.truth.q[segment])
        stiff = segment == "pelvis" or segment.startswith("foot")
        assert np.array_equal(bone.ideal[segment].gyr, skin.ideal[segment].gyr) == stiff
