"""Overlay of another visit: same stride phase, position and direction, only within strides."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import viser

from sagittal.core import rotation
from sagittal.core.angles import cardan_zxy
from sagittal.core.body.poses import Poses
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms import adult_kinematics
from sagittal.server.viewer.batches import PALE, RAISED_M
from sagittal.server.viewer.colours import GHOST, to_linear_rgb
from sagittal.server.viewer.ghost import PHASES, find_heading, match_ghost, match_reference
from sagittal.server.viewer.motion import GhostMotion, ReplayMotion, prepare_motion
from sagittal.server.viewer.reference import ReferenceWalk
from sagittal.server.viewer.replay.replay_figure import ReplayFigure
from tests.server import walk

TURN = np.radians(70.0)


def turned(poses: Poses) -> Poses:
    """The walk somewhere else, in another direction."""
    about = rotation.about(2, TURN)
    return replace(
        poses,
        q={s: rotation.multiply(about, q) for s, q in poses.q.items()},
        p={s: rotation.rotate(about, p) + np.array([3.0, -2.0, 0.0]) for s, p in poses.p.items()},
    )


OTHER = prepare_motion(turned(walk.poses(8.0)))


@pytest.fixture(scope="module")
def ghost(motion: ReplayMotion) -> GhostMotion:
    result = match_ghost(motion, walk.strides(), OTHER, walk.strides(8.0))
    assert result is not None
    return result


def counted(duration_s: float, side: Side = "left") -> list[tuple[float, float]]:
    mine = [s for s in walk.strides(duration_s).strides if s.side == side and s.excluded_reason is None]
    return [(s.start_s, s.end_s) for s in mine]


def test_both_are_at_the_same_phase_in_every_stride_that_counts(
    motion: ReplayMotion, ghost: GhostMotion
) -> None:
    theirs = counted(8.0)
    seen = 0
    for k, (start, end) in enumerate(counted(12.0)):
        a, b = theirs[k % len(theirs)]
        for i in np.flatnonzero((motion.t_s >= start) & (motion.t_s < end)):
            phase = (motion.t_s[i] - start) / (end - start)
            view = (OTHER.t_s[ghost.frames[i]] - a) / (b - a)
            assert abs(phase - view) <= 0.011 / (b - a)
            seen += 1
    assert seen > 300


def test_outside_the_strides_that_count_there_is_no_ghost(motion: ReplayMotion, ghost: GhostMotion) -> None:
    inside = np.zeros(len(motion.t_s), bool)
    for start, end in counted(12.0) + counted(12.0, "right"):
        inside |= (motion.t_s >= start) & (motion.t_s < end)
    np.testing.assert_array_equal(ghost.frames >= 0, inside)


def test_the_same_walk_elsewhere_falls_onto_the_figure(motion: ReplayMotion, ghost: GhostMotion) -> None:
    shanks, theirs = motion.batches["shanks"], ghost.batches["shanks"]
    start, end = counted(12.0)[2]
    for i in np.flatnonzero((motion.t_s >= start) & (motion.t_s < end))[::5]:
        np.testing.assert_allclose(theirs.position[i], shanks.position[i], atol=0.03)


def test_the_direction_is_that_of_the_way_and_on_the_spot_of_the_beginning(motion: ReplayMotion) -> None:
    assert np.degrees(np.ptp(find_heading(motion))) < 3.0
    still = replace(motion, root=np.zeros_like(motion.root), facing=0.4)
    np.testing.assert_allclose(find_heading(still), 0.4)


def test_without_a_side_that_counts_in_both_there_is_no_ghost(motion: ReplayMotion) -> None:
    none = replace(walk.strides(), strides=())
    assert match_ghost(motion, walk.strides(), motion, none) is None


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    started = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield started
    started.stop()


def test_the_figure_shows_it_pale_in_strides_and_hides_it_when_told(
    server: viser.ViserServer, motion: ReplayMotion, ghost: GhostMotion
) -> None:
    figure = ReplayFigure(server, replace(motion, ghosts={"visit": lambda: ghost, "norm": lambda: None}))
    assert figure._ghost == {}
    assert figure.set_ghost("visit")
    handles = [part.handle for part in figure._ghost.values()]
    assert set(figure._ghost) == {
        "thighs", "shanks", "foot_l", "foot_r", "toes_l", "toes_r", "pelvis"
    }  # fmt: skip
    assert {h.opacity for h in handles} == {PALE}
    start, end = counted(12.0)[1]
    figure.pose((start + end) / 2)
    assert all(h.visible for h in handles)
    assert {tuple(c) for c in np.asarray(handles[0].batched_colors).tolist()} == {to_linear_rgb(GHOST[False])}
    figure.pose(0.0)
    assert not any(h.visible for h in handles)
    figure.pose((start + end) / 2)
    # over the middle of the floor, whose lines they may not hide
    middle = (motion.root.min(axis=0) + motion.root.max(axis=0)) / 2
    for handle in handles:
        np.testing.assert_allclose(handle.position, (*middle, RAISED_M), atol=1e-5)
    figure.set_dark(True)
    assert {tuple(c) for c in np.asarray(handles[0].batched_colors).tolist()} == {to_linear_rgb(GHOST[True])}
    assert not figure.set_ghost("norm")
    assert figure._ghost == {}
    assert figure.set_ghost("visit")
    assert not figure.set_ghost(None)
    assert not any("ghost" in name for name in server.scene._handle_from_node_name)


def test_the_norm_over_a_replay_has_its_angles_at_the_phases_of_both_legs(motion: ReplayMotion) -> None:
    norm = {name: np.radians(band.mean_deg) for name, band in adult_kinematics(None).bands.items()}
    ghost = match_reference(motion, walk.strides(), ReferenceWalk(norm, walk.BODY))
    assert ghost is not None
    thighs, shanks = ghost.batches["thighs"].wxyz, ghost.batches["shanks"].wxyz
    for start, end in counted(12.0)[2:5]:
        for i in np.flatnonzero((motion.t_s >= start) & (motion.t_s < end))[::7]:
            row = round(PHASES * (motion.t_s[i] - start) / (end - start))
            knee = -cardan_zxy(rotation.multiply(rotation.conjugate(thighs[i, 0]), shanks[i, 0]))[0]
            assert knee == pytest.approx(norm["knee_flexion"][row], abs=1e-4)
    observations = ghost.frames >= 0
    assert (
        len(np.unique(ghost.frames[observations])) < 0.5 * observations.sum()
    )  # a pair of phases is posed once
    pelvis = ghost.batches["pelvis"].position[:, 0, :2]
    np.testing.assert_allclose(pelvis[observations], motion.root[observations], atol=1e-4)
    assert (
        match_reference(motion, replace(walk.strides(), strides=()), ReferenceWalk(norm, walk.BODY)) is None
    )


def test_every_side_can_carry_the_match() -> None:
    only_right = replace(
        walk.strides(), strides=tuple(s for s in walk.strides().strides if s.side == SIDES[1])
    )
    motion = prepare_motion(walk.poses())
    result = match_ghost(motion, only_right, motion, walk.strides())
    assert result is not None
    assert (result.frames >= 0).any()
