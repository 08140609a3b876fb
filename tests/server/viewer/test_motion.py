from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from core import rotation
from core.body.poses import Poses
from core.errors import ParameterError
from core.frames import FOOT, SHANK, SIDES, Segment, Side
from server.viewer.colours import TINTS, to_linear_rgb
from server.viewer.motion import ReplayMotion, prepare_motion
from server.viewer.shapes import make_letter
from tests.data import ROOT
from tests.server import walk


def subset(poses: Poses, *segments: Segment) -> Poses:
    return replace(
        poses,
        q={s: poses.q[s] for s in segments},
        p={s: poses.p[s] for s in segments},
        contact={s: c for s, c in poses.contact.items() if s in segments},
    )


def transformed(
    motion: ReplayMotion, name: str, k: int, i: int, point: tuple[float, float, float]
) -> np.ndarray:
    """Where the viewer draws a mesh point of copy k at frame i."""
    batch = motion.batches[name]
    turned = rotation.rotate(batch.wxyz[i, k].astype(float), np.array(point) * batch.scale[k])
    return np.asarray(turned + batch.position[i, k])


def test_bones_reach_from_joint_to_joint(motion: ReplayMotion) -> None:
    poses = walk.poses()
    for i in (0, 133, 400):
        frame = 2 * i  # thinned from 100 to 50 frames a second
        assert motion.t_s[i] == poses.t_s[frame]
        ends: dict[Segment, Segment] = {
            "thigh_l": "shank_l",
            "shank_l": "foot_l",
            "thigh_r": "shank_r",
            "shank_r": "foot_r",
        }
        for k, (start, end) in enumerate(ends.items()):
            np.testing.assert_allclose(
                transformed(motion, "bones", k, i, (0, 0, 0)),
                poses.p[start][frame],
                atol=1e-5,
            )
            np.testing.assert_allclose(
                transformed(motion, "bones", k, i, (0, 0, 1)),
                poses.p[end][frame],
                atol=1e-5,
            )


def test_left_and_right_have_the_colours_of_the_charts(motion: ReplayMotion) -> None:
    assert motion.batches["bones"].tint[:4] == ("left", "left", "right", "right")
    assert motion.batches["shoes"].tint == ("left", "right")
    tokens = (ROOT / "web/static/css/tokens.css").read_text()
    for side in SIDES:
        named = re.search(rf"--{side}: light-dark\((#\w+), (#\w+)\);", tokens)
        assert named
        for dark in (False, True):
            assert named[1 + dark] == "#{:02X}{:02X}{:02X}".format(*TINTS[dark][side])


def test_soles_stand_on_the_floor(motion: ReplayMotion) -> None:
    vertices = motion.batches["shoes"].mesh[0]
    lowest = [
        min(transformed(motion, "shoes", k, i, tuple(v))[2] for k in (0, 1) for v in vertices[::7])
        for i in range(0, 200, 40)
    ]
    assert max(abs(z) for z in lowest) < 0.02


def test_the_figure_stays_in_view_while_its_sway_is_kept(motion: ReplayMotion) -> None:
    poses = walk.poses()
    middle = slice(50, -50)
    offset = poses.p["pelvis"][::2, :2][middle] - motion.root[middle]
    assert np.abs(offset[:, 0]).max() < 0.03
    assert 0.01 < np.abs(offset[:, 1]).max() < 0.04


def test_positions_that_are_for_the_eye_only_leave_no_trail() -> None:
    poses = walk.poses(3.0)
    seen = prepare_motion(replace(poses, method="stance_foot_anchor"))
    assert not seen.placed
    assert seen.trails == {}
    assert set(seen.prints) == {"left", "right"}
    assert set(prepare_motion(replace(poses, method="erkf_smoothed")).trails) == {"left", "right"}


@pytest.mark.parametrize(
    ("method", "measured"),
    [
        ("erkf_smoothed", {"pelvis", "thigh", "shank", "foot"}),
        ("l7s_3i", {"pelvis", "foot"}),
        ("l7s_2i", {"foot"}),
    ],
)
def test_what_no_sensor_supports_is_marked(method: str, measured: set[str]) -> None:
    seen = prepare_motion(replace(walk.poses(3.0), method=method))
    thigh, shank, foot, pelvis = (x in measured for x in ("thigh", "shank", "foot", "pelvis"))
    assert seen.batches["bones"].measured == (thigh, shank, thigh, shank, shank, shank, pelvis, pelvis)
    assert seen.batches["shoes"].measured == (foot, foot)
    assert seen.measured == (thigh and pelvis)


def test_lost_samples_are_marked_and_never_nan() -> None:
    poses = walk.poses(lost=(3.0, 4.0))
    poses.q["shank_l"][300:400] = np.nan
    found = prepare_motion(poses)
    assert not found.valid[found.index(3.5)]
    assert found.valid[found.index(2.9)]
    assert all(np.isfinite(b.wxyz).all() and np.isfinite(b.position).all() for b in found.batches.values())
    assert np.isfinite(found.root).all()


def test_times_outside_are_held_at_the_ends(motion: ReplayMotion) -> None:
    assert motion.index(-5.0) == 0
    assert motion.index(1e9) == len(motion.t_s) - 1
    assert motion.t_s[motion.index(3.009)] == pytest.approx(3.0)
    assert motion.t_s[motion.index(3.011)] == pytest.approx(3.02)


@pytest.mark.parametrize(
    "segments", [("foot_l", "foot_r"), ("pelvis", "foot_l", "foot_r"), ("pelvis",), ("thigh_r", "shank_r")]
)
def test_any_subset_of_segments_makes_a_figure(segments: tuple[Segment, ...]) -> None:
    found = prepare_motion(subset(walk.poses(), *segments))
    for side in SIDES:
        assert len(found.batches[f"letters_{side}"].tint) == (SHANK[side] in segments)
    assert sum(len(b.tint) for b in found.batches.values()) >= 1


def test_the_letter_of_a_side_lies_on_its_own_shank_in_the_colour_of_the_leg(motion: ReplayMotion) -> None:
    poses = walk.poses()
    for side in SIDES:
        batch = motion.batches[f"letters_{side}"]
        assert batch.tint == (side,)
        for i in range(0, len(motion.t_s), 7):  # at mid-stride too
            knee, ankle = (poses.p[s][2 * i] for s in (SHANK[side], FOOT[side]))
            points = np.array([transformed(motion, f"letters_{side}", 0, i, v) for v in batch.mesh[0][::9]])
            along = (points - knee) @ (ankle - knee) / np.dot(ankle - knee, ankle - knee)
            assert 0.2 < along.min() < along.max() < 0.8
            beside = np.linalg.norm(points - knee - along[:, None] * (ankle - knee), axis=1)
            assert 0.04 < beside.min() < beside.max() < 0.08


@pytest.mark.parametrize("side", SIDES)
def test_a_letter_faces_outwards_and_is_not_mirrored(side: Side) -> None:
    vertices, faces = make_letter(side, 0.05, 0.14, 0.1)
    a, b, c = (vertices[faces[:, k]].astype(float) for k in range(3))
    normal, middle = np.cross(b - a, c - a), (a + b + c) / 3
    assert (np.einsum("ij,ij->i", normal[:, :2], middle[:, :2]) > 0).all()
    # seen from the front of the bone (+x), hanging (mesh z down): right is −y
    front = middle[(middle[:, 0] > 0.02) & (abs(middle[:, 1]) < 0.03)]
    area = np.linalg.norm(normal, axis=1)[(middle[:, 0] > 0.02) & (abs(middle[:, 1]) < 0.03)]
    right, down = -front[:, 1], front[:, 2]
    foot, head = down > 0.09, down < 0.05
    if side == "left":  # a foot to the right, nothing at the head there
        assert area[foot & (right > 0.005)].sum() > 0
        assert area[head & (right > 0.005)].sum() == 0
    else:  # a bowl at the head, to the right of the upright
        assert area[head & (right > 0.005)].sum() > 0
        assert area[head & (right < -0.005)].sum() > 0


def test_no_pose_at_all_says_so() -> None:
    with pytest.raises(ParameterError) as refused:
        prepare_motion(subset(walk.poses()))
    assert refused.value.code == "no_figure"


def test_colour_of_an_instance_is_linear_light() -> None:
    assert to_linear_rgb((0, 128, 255)) == (0, 55, 255)
