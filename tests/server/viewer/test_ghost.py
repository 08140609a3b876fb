"""A visit laid over another: same phase of a stride, same place and direction, nothing outside strides."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import viser

from core import rotation
from core.body.poses import Poses
from core.frames import SIDES, Side
from server.viewer.colours import GHOST, to_linear_rgb
from server.viewer.ghost import find_heading, match_ghost
from server.viewer.motion import GhostMotion, ReplayMotion, prepare_motion
from server.viewer.replay_figure import ReplayFigure
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


@pytest.fixture(scope="module")
def ghost(motion: ReplayMotion) -> GhostMotion:
    made = match_ghost(motion, walk.strides(), prepare_motion(turned(walk.poses(8.0))), walk.strides(8.0))
    assert made is not None
    return made


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
            shown = (ghost.motion.t_s[ghost.frames[i]] - a) / (b - a)
            assert abs(phase - shown) <= 0.011 / (b - a)
            seen += 1
    assert seen > 300


def test_outside_the_strides_that_count_there_is_no_ghost(motion: ReplayMotion, ghost: GhostMotion) -> None:
    inside = np.zeros(len(motion.t_s), bool)
    for start, end in counted(12.0) + counted(12.0, "right"):
        inside |= (motion.t_s >= start) & (motion.t_s < end)
    np.testing.assert_array_equal(ghost.frames >= 0, inside)


def test_the_same_walk_elsewhere_falls_onto_the_figure(motion: ReplayMotion, ghost: GhostMotion) -> None:
    bones, theirs = motion.batches["bones"], ghost.motion.batches["bones"]
    start, end = counted(12.0)[2]
    for i in np.flatnonzero((motion.t_s >= start) & (motion.t_s < end))[::5]:
        about = rotation.about(2, ghost.turn[i])
        place = np.append(ghost.place[i], 0.0)
        moved = rotation.rotate(about, theirs.position[ghost.frames[i]].astype(float)) + place
        np.testing.assert_allclose(moved, bones.position[i], atol=0.03)


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
    figure = ReplayFigure(server, replace(motion, ghost=ghost))
    handles = [handle for _, handle in figure._ghost_batches]
    assert len(handles) == 3
    start, end = counted(12.0)[1]
    figure.pose((start + end) / 2)
    assert all(h.visible for h in handles)
    assert tuple(handles[0].batched_colors) == to_linear_rgb(GHOST[False])
    figure.pose(0.0)
    assert not any(h.visible for h in handles)
    figure.pose((start + end) / 2)
    figure.set_ghost(False)
    assert not any(h.visible for h in handles)
    figure.set_dark(True)
    assert tuple(handles[0].batched_colors) == to_linear_rgb(GHOST[True])


def test_every_side_can_carry_the_match() -> None:
    only_right = replace(
        walk.strides(), strides=tuple(s for s in walk.strides().strides if s.side == SIDES[1])
    )
    motion = prepare_motion(walk.poses())
    made = match_ghost(motion, only_right, motion, walk.strides())
    assert made is not None
    assert (made.frames >= 0).any()
