"""Drawing shown until the 3D view is ready."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

import numpy as np
import pytest

from sagittal.server.viewer.first_picture import HEIGHT, draw_first_picture
from sagittal.server.viewer.motion import ReplayMotion, prepare_motion
from sagittal.server.viewer.room import FOV_RAD, frame_person
from tests.server import walk

CLOSE: Final = 4
"""Units that a drawing may miss a point by: lines are in whole ones and leave points out."""


def outlines(svg: str, css: str) -> np.ndarray:
    """All points (n, 2) of the paths of a class, from the middle of the picture to the right and down."""
    points = []
    for path in re.findall(rf'<path class="{css}"[^>]* d="([^"]*)"', svg):
        for x, y, steps in re.findall(r"M(-?\d+) (-?\d+)l([^zM]*)", path):
            moves = np.array(re.findall(r"-?\d+", steps), int).reshape(-1, 2)
            points.append(np.cumsum(np.vstack(([int(x), int(y)], moves)), axis=0))
    return np.concatenate(points)


def see(motion: ReplayMotion, point: np.ndarray, frame: int) -> np.ndarray:
    """A point of the room, m, as the camera of the 3D view shows it: three.js's matrices, written out."""
    shot = frame_person(motion.size, motion.facing)
    eye, values = np.array(shot.eye), np.array(shot.at)
    back = (eye - values) / np.linalg.norm(eye - values)
    side = np.cross([0.0, 0.0, 1.0], back)
    side /= np.linalg.norm(side)
    view = np.stack((side, np.cross(back, side), back))
    x, y, z = view @ (point - np.append(motion.root[frame], 0.0) - eye)
    return np.asarray(np.array([x, -y]) / -z / np.tan(FOV_RAD / 2) * HEIGHT / 2)


@pytest.fixture(scope="module")
def turned() -> ReplayMotion:
    """The walk of the tests, which has been somewhere before."""
    return prepare_motion(replace(walk.poses(6.0), method="erkf_smoothed"))


@pytest.mark.parametrize("t_s", [0.5, 3.3])
def test_every_part_is_where_the_3d_view_will_show_it(turned: ReplayMotion, t_s: float) -> None:
    svg, frame = draw_first_picture(turned, t_s), turned.index(t_s)
    assert svg is not None
    for css, side in (("fp-l", 0), ("fp-r", 1)):
        leg = outlines(svg, css)
        knee = see(turned, turned.batches["shanks"].position[frame, side].astype(float), frame)
        assert (leg.min(axis=0) - CLOSE < knee).all()
        assert (knee < leg.max(axis=0) + CLOSE).all()
    trunk = turned.batches["trunk"]
    top = trunk.position[frame, 0] + (0.0, 0.0, float(trunk.mesh[0][:, 1].max()))
    assert outlines(svg, "fp-b")[:, 1].min() == pytest.approx(see(turned, top, frame)[1], abs=CLOSE)


def test_it_shows_the_steps_until_then_and_no_later_ones(turned: ReplayMotion) -> None:
    early, late = (draw_first_picture(turned, t_s) or "" for t_s in (0.1, 3.3))
    left = "fp-print fp-l"
    assert len(outlines(late, left)) > (len(outlines(early, left)) if left in early else 0)
    assert "fp-lines" in early


def test_a_part_that_nothing_measures_is_pale() -> None:
    poses = walk.poses(2.0)
    feet = prepare_motion(replace(poses, method="l7s_2i"))
    assert 'class="fp-l" opacity="0.35"' in (draw_first_picture(feet, 1.0) or "")


def test_nothing_is_drawn_where_a_sensor_was_lost() -> None:
    lost = prepare_motion(walk.poses(4.0, lost=(1.0, 2.0)))
    assert draw_first_picture(lost, 1.5) is None
    assert draw_first_picture(lost, 2.5) is not None
