"""Floor elements of a real viser scene at a moment, and their cost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import viser

from sagittal.server.viewer.motion import ReplayMotion, prepare_motion
from sagittal.server.viewer.replay.replay_figure import ReplayFigure
from sagittal.server.viewer.replay.replay_floor import CHUNK, RECENT_PRINTS
from tests.server import walk

LONG_S = 120.0


class Scene:
    """A figure in a viser server, and the scene nodes it has made."""

    def __init__(self, server: viser.ViserServer, motion: ReplayMotion) -> None:
        self.figure = ReplayFigure(server, motion)
        self.nodes = dict(server.scene._handle_from_node_name)

    def __getitem__(self, name: str) -> viser.SceneNodeHandle:
        return self.nodes[name]

    def drawn(self, side: str) -> np.ndarray:
        """Pieces (k, 2, 3) of the trail of a side that are to be seen, in order of time."""
        chunks = [n for name, n in self.nodes.items() if name.startswith(f"/room/ground/trail_{side}")]
        values = [np.asarray(n.points) for n in chunks if n.visible]
        return np.concatenate(values) if values else np.zeros((0, 2, 3))

    def prints(self, side: str) -> np.ndarray:
        """Which prints of a side are to be seen."""
        return np.flatnonzero(np.asarray(self[f"/room/ground/prints_{side}"].batched_scales))


@pytest.fixture(scope="module")
def long_walk() -> ReplayMotion:
    return prepare_motion(replace(walk.poses(LONG_S), method="erkf_smoothed"))


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    started = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield started
    started.stop()


WAYS = [(5.0,), (110.0, 5.0), (1.0, 60.0, 119.0, 30.0), (119.9, 0.0)]


@pytest.mark.parametrize("way", WAYS)
def test_standing_back_shows_all_that_was_left_whatever_was_shown_before(
    server: viser.ViserServer, long_walk: ReplayMotion, way: tuple[float, ...]
) -> None:
    scene = Scene(server, long_walk)
    for t_s in way:
        scene.figure.pose(t_s)
    scene.figure.set_follow(False)
    for side, trail in long_walk.trails.items():
        past = trail.t_s <= way[-1] + 0.01
        np.testing.assert_array_equal(scene.drawn(side), trail.pieces[past])
        left = np.flatnonzero(long_walk.prints[side].t_s <= way[-1] + 0.01)
        np.testing.assert_array_equal(scene.prints(side), left)


@pytest.mark.parametrize("way", WAYS)
def test_following_shows_the_last_strides_whatever_was_shown_before(
    server: viser.ViserServer, long_walk: ReplayMotion, way: tuple[float, ...]
) -> None:
    scene = Scene(server, long_walk)
    scene.figure.set_follow(False)
    for t_s in way:
        scene.figure.pose(t_s)
    scene.figure.set_follow(True)
    for side, trail in long_walk.trails.items():
        past = trail.pieces[trail.t_s <= way[-1] + 0.01]
        drawn = scene.drawn(side)
        assert min(len(past), CHUNK) <= len(drawn) < 2 * CHUNK
        np.testing.assert_array_equal(drawn, past[len(past) - len(drawn) :])
        left = np.flatnonzero(long_walk.prints[side].t_s <= way[-1] + 0.01)
        np.testing.assert_array_equal(scene.prints(side), left[-RECENT_PRINTS:])


def test_a_frame_sends_at_most_one_chunk_of_a_trail(
    server: viser.ViserServer, long_walk: ReplayMotion
) -> None:
    scene = Scene(server, long_walk)
    lengths = []
    for t_s in np.linspace(0, LONG_S, 60):
        scene.figure.pose(t_s)
        lengths += [len(scene[f"/room/ground/trail_{s}_rest"].points) for s in ("left", "right")]
    assert max(lengths) < CHUNK


def test_where_positions_are_for_the_eye_only_there_are_prints_and_no_trail(
    server: viser.ViserServer,
) -> None:
    scene = Scene(server, prepare_motion(replace(walk.poses(12.0), method="stance_foot_anchor")))
    scene.figure.pose(11.0)
    assert len(scene.prints("left")) >= 9
    assert len(scene.drawn("left")) == 0


def test_prints_and_trails_can_be_hidden_together(server: viser.ViserServer, long_walk: ReplayMotion) -> None:
    scene = Scene(server, long_walk)
    scene.figure.set_ground(False)
    assert not scene["/room/ground"].visible
    scene.figure.set_ground(True)
    assert scene["/room/ground"].visible


def test_following_keeps_the_person_in_the_middle_and_letting_go_keeps_the_room_still(
    server: viser.ViserServer, long_walk: ReplayMotion
) -> None:
    scene = Scene(server, long_walk)

    def places() -> tuple[np.ndarray, np.ndarray]:
        room = np.asarray(scene["/room"].position)
        shoe = np.asarray(scene["/room/foot_l"].batched_positions)[0]
        return room, room + shoe

    for t_s in (10.0, 60.0, 110.0):
        scene.figure.pose(t_s)
        assert np.hypot(*places()[1][:2]) < 1.0
    scene.figure.set_follow(False)
    still, place = places()
    assert place[0] > 40
    scene.figure.pose(10.0)
    np.testing.assert_array_equal(places()[0], still)
    assert places()[1][0] < -40
    scene.figure.set_follow(True)
    assert np.hypot(*places()[1][:2]) < 1.0


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_the_whole_walk_is_in_a_square_picture(
    server: viser.ViserServer, long_walk: ReplayMotion, heading: float
) -> None:
    figure = ReplayFigure(server, replace(long_walk, facing=heading))
    figure.set_follow(False)
    camera = server.initial_camera
    eye = np.asarray(camera.position)
    sight = np.asarray(camera.look_at) - eye
    sight /= np.linalg.norm(sight)
    right = np.cross(sight, [0, 0, 1])
    right /= np.linalg.norm(right)
    ground = long_walk.root - (long_walk.root.min(axis=0) + long_walk.root.max(axis=0)) / 2
    for height in (0.0, 1.8):
        rays = np.column_stack((ground, np.full(len(ground), height))) - eye
        ahead = rays @ sight
        assert np.all(ahead > 0)
        for axis in (right, np.cross(right, sight)):
            assert np.all(np.abs(rays @ axis) <= np.tan(camera.fov / 2) * ahead)
