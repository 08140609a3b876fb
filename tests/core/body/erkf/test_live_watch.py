"""Live joint residuals: one notice, after a window of movement."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body import BodyModel
from sagittal.core.body.erkf.health import RESIDUAL_MM
from sagittal.core.body.erkf.live_watch import WINDOW_S, JointWatch
from sagittal.core.body.tree import ImuTree, person_tree
from sagittal.core.errors import Notice
from sagittal.core.frames import Segment

RATE = 20.0
WINDOW = round(WINDOW_S * RATE)
FAR_M = 1e-3 * RESIDUAL_MM[0]


def tree() -> ImuTree:
    segments: tuple[Segment, ...] = ("thigh_l", "shank_l", "foot_l")
    return person_tree(BodyModel.from_height(1.7), {s: np.eye(3) for s in segments}, segments)


def push(
    watch: JointWatch,
    samples: int,
    knee_m: float,
    ankle_m: float = 0.0,
    *,
    rest: bool = False,
    lost: int = -1,
) -> list[Notice]:
    valid = np.ones((samples, 3), np.bool_)
    if lost >= 0:
        valid[:, lost] = False
    still = np.full((samples, 3, 2), rest)
    return watch.push(np.tile([knee_m, ankle_m], (samples, 1)), valid, still)


def test_a_joint_whose_ends_are_apart_is_told_once_a_window_is_full() -> None:
    watch = JointWatch(tree(), RATE)
    assert push(watch, WINDOW - 1, 1.12 * FAR_M) == []
    (notice,) = push(watch, 1, 1.12 * FAR_M)
    assert (notice.code, notice.sensor, notice.severity) == (
        "sensors_do_not_hang_together",
        "shank_l",
        "warning",
    )
    assert "28 mm apart" in notice.message
    assert push(watch, WINDOW, 5.0 * FAR_M) == []
    (other_frame,) = push(watch, WINDOW, 0.0, 2.0 * FAR_M)
    assert other_frame.sensor == "foot_l"
    assert "50 mm apart" in other_frame.message


def test_the_mean_of_the_squares_decides() -> None:
    watch = JointWatch(tree(), RATE)
    assert push(watch, WINDOW // 2, 0.0) == []
    assert push(watch, WINDOW // 2, 1.4 * FAR_M) == []
    assert push(watch, WINDOW // 2, 0.0) == []
    assert len(push(watch, WINDOW // 2, 1.42 * FAR_M)) == 1


@pytest.mark.parametrize("how", ["rest", "proximal", "distal"])
def test_rest_and_lost_sensors_say_nothing_of_a_joint(how: str) -> None:
    watch = JointWatch(tree(), RATE)
    lost = {"rest": -1, "proximal": 0, "distal": 1}[how]
    for _ in range(3):
        assert push(watch, WINDOW, 5.0 * FAR_M, rest=how == "rest", lost=lost) == []


def test_a_foot_that_rests_while_the_other_sensors_move_is_no_rest() -> None:
    watch = JointWatch(tree(), RATE)
    still = np.zeros((WINDOW, 3, 2), np.bool_)
    still[:, 2] = True
    still[:, :, 0] = True
    apart = np.tile([2.0 * FAR_M, 0.0], (WINDOW, 1))
    assert len(watch.push(apart, np.ones((WINDOW, 3), np.bool_), still)) == 1
