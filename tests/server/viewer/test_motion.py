from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core import rotation
from sagittal.core.body.poses import Poses
from sagittal.core.errors import ParameterError
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Segment, Side
from sagittal.server.viewer.body_parts import PartName
from sagittal.server.viewer.colours import TINTS, to_linear_rgb
from sagittal.server.viewer.motion import LOWER_BODY, ReplayMotion, prepare_motion
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
    motion: ReplayMotion, name: PartName, k: int, i: int, point: tuple[float, float, float]
) -> np.ndarray:
    """Where the viewer draws a mesh point of copy k at frame i."""
    batch = motion.batches[name]
    turned = rotation.rotate(batch.wxyz[i, k].astype(float), np.array(point, float))
    return np.asarray(turned + batch.position[i, k])


def test_limbs_reach_from_joint_to_joint(motion: ReplayMotion) -> None:
    poses = walk.poses()
    for i in (0, 133, 400):
        frame = 2 * i  # thinned from 100 to 50 frames a second
        assert motion.t_s[i] == poses.t_s[frame]
        limbs: tuple[tuple[PartName, float, Mapping[Side, Segment], Mapping[Side, Segment]], ...] = (
            ("thighs", walk.BODY.thigh, THIGH, SHANK),
            ("shanks", walk.BODY.shank, SHANK, FOOT),
        )
        for name, length, start, end in limbs:
            for k, side in enumerate(SIDES):
                upper = transformed(motion, name, k, i, (0, 0, 0))
                lower = transformed(motion, name, k, i, (0, -length, 0))
                np.testing.assert_allclose(upper, poses.p[start[side]][frame], atol=1e-5)
                np.testing.assert_allclose(lower, poses.p[end[side]][frame], atol=1e-5)


def test_left_and_right_have_the_colours_of_the_charts(motion: ReplayMotion) -> None:
    assert motion.batches["thighs"].tint == motion.batches["shanks"].tint == ("left", "right")
    assert (motion.batches["foot_l"].tint, motion.batches["foot_r"].tint) == (("left",), ("right",))
    tokens = (ROOT / "web/static/css/base.css").read_text()
    for side in SIDES:
        named = re.search(rf"--{side}: light-dark\((#\w+), (#\w+)\);", tokens)
        assert named
        for dark in (False, True):
            assert named[1 + dark] == "#{:02X}{:02X}{:02X}".format(*TINTS[dark][side])


def lowest_of(motion: ReplayMotion, names: tuple[PartName, ...], i: int) -> float:
    """Height of the lowest vertex of some parts at frame i, m."""
    result = []
    for name in names:
        batch = motion.batches[name]
        for k in range(len(batch.tint)):
            turned = rotation.rotate(batch.wxyz[i, k].astype(float), batch.mesh[0].astype(float))
            result.append((turned + batch.position[i, k])[:, 2].min())
    return float(min(result))


FEET: tuple[PartName, ...] = ("foot_l", "foot_r", "toes_l", "toes_r")
TOES_AND_FOOT: Mapping[Side, tuple[PartName, PartName]] = {
    "left": ("toes_l", "foot_l"),
    "right": ("toes_r", "foot_r"),
}


def toe_bend(motion: ReplayMotion, side: Side) -> np.ndarray:
    """Angle of the toes against the foot in each frame, degrees."""
    toes, foot = (motion.batches[name].wxyz[:, 0].astype(float) for name in TOES_AND_FOOT[side])
    return np.asarray(np.degrees(2 * np.arccos(np.clip(np.einsum("ij,ij->i", toes, foot), -1.0, 1.0))))


def test_soles_stand_on_the_floor(motion: ReplayMotion) -> None:
    lowest = [lowest_of(motion, FEET, i) for i in range(0, 200, 5)]
    assert max(lowest) < 0.02
    assert min(lowest) > -0.012


def test_toes_bend_where_a_foot_in_one_piece_would_sink_into_the_floor(motion: ReplayMotion) -> None:
    # the tips of this walk's feet never sink in; lowered, they would by 3 cm at push-off
    poses = walk.poses()
    lowered = {s: p - np.array([0.0, 0.0, 0.03]) for s, p in poses.p.items()}
    sunk = prepare_motion(replace(poses, p=lowered))
    for side in SIDES:
        toes, foot = TOES_AND_FOOT[side]
        assert toe_bend(motion, side).max() < 1.0
        bend = toe_bend(sunk, side)
        assert bend.max() > 15.0
        i = int(np.argmax(bend))
        stiff = {**sunk.batches, toes: replace(sunk.batches[toes], wxyz=sunk.batches[foot].wxyz)}
        assert lowest_of(sunk, (toes,), i) > lowest_of(replace(sunk, batches=stiff), (toes,), i) + 0.01


def test_the_figure_stays_in_view_while_its_sway_is_kept(motion: ReplayMotion) -> None:
    poses = walk.poses()
    middle = slice(50, -50)
    offset = poses.p["pelvis"][::2, :2][middle] - motion.root[middle]
    assert np.abs(offset[:, 0]).max() < 0.03
    assert 0.01 < np.abs(offset[:, 1]).max() < 0.04


def test_positions_that_are_for_the_eye_only_leave_no_trail() -> None:
    poses = walk.poses(3.0)
    observations = prepare_motion(replace(poses, method="stance_foot_anchor"))
    assert not observations.placed
    assert observations.trails == {}
    assert set(observations.prints) == {"left", "right"}
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
    observations = prepare_motion(replace(walk.poses(3.0), method=method))
    thigh, shank, foot, pelvis = (x in measured for x in ("thigh", "shank", "foot", "pelvis"))
    expected: dict[PartName, bool] = {"thighs": thigh, "shanks": shank, "foot_l": foot, "toes_r": foot}
    for name, segment_names in expected.items():
        assert set(observations.batches[name].measured) == {segment_names}, name
    assert observations.batches["pelvis"].measured == observations.batches["trunk"].measured == (pelvis,)
    assert observations.measured == (thigh and pelvis)


def test_lost_samples_are_marked_and_never_nan() -> None:
    poses = walk.poses(lost=(3.0, 4.0))
    poses.q["shank_l"][300:400] = np.nan
    result = prepare_motion(poses)
    assert not result.valid[result.index(3.5)]
    assert result.valid[result.index(2.9)]
    assert all(np.isfinite(b.wxyz).all() and np.isfinite(b.position).all() for b in result.batches.values())
    assert np.isfinite(result.root).all()


def test_times_outside_are_held_at_the_ends(motion: ReplayMotion) -> None:
    assert motion.index(-5.0) == 0
    assert motion.index(1e9) == len(motion.t_s) - 1
    assert motion.t_s[motion.index(3.009)] == pytest.approx(3.0)
    assert motion.t_s[motion.index(3.011)] == pytest.approx(3.02)


@pytest.mark.parametrize(
    "segments", [("foot_l", "foot_r"), ("pelvis", "foot_l", "foot_r"), ("pelvis",), ("thigh_r", "shank_r")]
)
def test_any_subset_of_segments_makes_a_figure(segments: tuple[Segment, ...]) -> None:
    result = prepare_motion(subset(walk.poses(), *segments))
    assert ("rings" in result.batches) == ("shank_r" in segments)
    assert result.batches
    assert set(result.hidden) | set(segments) == set(LOWER_BODY)
    assert not set(result.hidden) & set(segments)


def test_no_pose_at_all_says_so() -> None:
    with pytest.raises(ParameterError) as refused:
        prepare_motion(subset(walk.poses()))
    assert refused.value.code == "no_figure"


def test_colour_of_an_instance_is_linear_light() -> None:
    assert to_linear_rgb((0, 128, 255)) == (0, 55, 255)
