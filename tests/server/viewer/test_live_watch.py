"""Estimator output to avatar, and selection of the overlaid walk."""

from __future__ import annotations

import time
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
import viser

from sagittal.core.angles import cardan_zxy
from sagittal.core.angles.measure import measure_angles
from sagittal.core.frames import SHANK, SIDES, THIGH, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.norms import adult_kinematics, look_up_norms
from sagittal.core.rotation import conjugate, multiply
from sagittal.server.live.messages import STALE_S, Picture
from sagittal.server.live.room import Room
from sagittal.server.viewer.live.live_figure import LiveFigure
from sagittal.server.viewer.live.live_reference import LiveReference, find_standing_angles
from sagittal.server.viewer.live.moment import FigureMoment
from sagittal.server.viewer.live_watch import FeedFrame, LiveWatch, read_moment
from sagittal.server.viewer.reference import SEGMENTS, ReferenceWalk, add_standing_angles, find_better_side
from tests.server import walk
from tests.server.viewer import pictures
from tests.server.viewer.pictures import Leg, picture, stride

NORM = {name: np.radians(band.mean_deg) for name, band in adult_kinematics(None).bands.items()}


class Bedside:
    """A figure and the watch that shows it."""

    def __init__(self, server: viser.ViserServer) -> None:
        self.figure = LiveFigure(server, walk.BODY)
        self.ghost: object = "none"
        self.strides: tuple[bytes, ...] = ()
        self.looks = True
        self.trained: Side | None = None
        self.watch = LiveWatch(
            self.figure,
            LiveReference(walk.BODY, lambda _: NORM, lambda: self.trained),
            ghost=lambda: self.ghost,
            strides=lambda: self.strides,
            watched=lambda: self.looks,
        )
        self._nodes = server.scene._handle_from_node_name

    @property
    def has_ghost(self) -> bool:
        return any(node.startswith("/room/ghost_") for node in self._nodes)

    @property
    def thighs(self) -> np.ndarray:
        drawn = [node for node in self._nodes if node.startswith("/room/thighs_")]
        return np.asarray(self._nodes[drawn[-1]].batched_positions).astype(float)


@pytest.fixture
def bedside() -> Iterator[Bedside]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield Bedside(server)
    server.stop()


def test_pictures_pose_the_figure(bedside: Bedside) -> None:
    for i in (10, 50):
        bedside.watch.see(picture(i))
        np.testing.assert_allclose(bedside.thighs[0], pictures.POSES.p["thigh_l"][i], atol=1e-6)
    assert not bedside.figure.is_grey


def test_silence_makes_the_figure_grey_and_the_next_picture_gives_the_colours_back(bedside: Bedside) -> None:
    bedside.watch.see(picture(10))
    bedside.watch.look()
    assert not bedside.figure.is_grey
    time.sleep(STALE_S + 0.05)
    bedside.watch.look()
    assert bedside.figure.is_grey
    bedside.watch.see(picture(11))
    assert not bedside.figure.is_grey
    bedside.watch.see(picture(12, delay_s=STALE_S + 0.1))
    assert bedside.figure.is_grey
    bedside.watch.see(picture(13, delay_s=None))
    assert bedside.figure.is_grey


def test_nothing_is_posed_while_nobody_looks_and_who_comes_sees_the_newest(bedside: Bedside) -> None:
    bedside.looks = False
    standing = bedside.thighs
    bedside.watch.see(picture(10))
    bedside.watch.see(picture(40))
    bedside.watch.look()
    np.testing.assert_array_equal(bedside.thighs, standing)
    bedside.looks = True
    bedside.watch.look()
    np.testing.assert_allclose(bedside.thighs[0], pictures.POSES.p["thigh_l"][40], atol=1e-6)


def test_without_poses_somebody_stands_until_calibrated_and_stays_when_they_are_lost(
    bedside: Bedside,
) -> None:
    standing = bedside.thighs
    bedside.watch.see(picture(0, stage="walk", q={}, p={}))
    np.testing.assert_array_equal(bedside.thighs, standing)
    bedside.watch.see(picture(30))
    walking = bedside.thighs
    bedside.watch.see(picture(31, q={}, p={}))
    np.testing.assert_array_equal(bedside.thighs, walking)
    assert bedside.figure.is_grey
    bedside.watch.see(picture(0, take="another", stage="stand", q={}, p={}))
    np.testing.assert_array_equal(bedside.thighs, standing)


def test_a_picture_that_cannot_be_shown_disturbs_nobody_and_the_figure_turns_grey(
    bedside: Bedside, caplog: pytest.LogCaptureFixture
) -> None:
    room = Room()
    with room.watching(bedside.watch.see):
        room.show(picture(10))
        for i in (11, 12):
            room.show(msgspec.structs.replace(picture(i), body=b"{"))
        assert len(caplog.records) == 1
        bedside.watch.look()
        assert bedside.figure.is_grey
        room.show(picture(13))
        assert not bedside.figure.is_grey


def test_the_ghost_follows_the_choice_of_the_therapist(bedside: Bedside) -> None:
    bedside.watch.see(picture(30))
    assert not bedside.has_ghost
    bedside.ghost = "norm"
    bedside.watch.see(picture(31))
    assert bedside.has_ghost
    bedside.ghost = "better"
    bedside.watch.see(picture(32))
    assert not bedside.has_ghost  # no strides yet
    bedside.strides = (stride(0, Leg("left", 0.5)), stride(1, Leg("right")))
    bedside.watch.see(picture(33))
    assert bedside.has_ghost
    bedside.ghost = None
    bedside.watch.see(picture(34))
    assert not bedside.has_ghost


def reference(trained: Side | None = None, norm: dict[str, np.ndarray] = NORM) -> LiveReference:
    return LiveReference(walk.BODY, lambda _: norm, lambda: trained)


def knee(result: ReferenceWalk | None, phase: float) -> float:
    """Knee flexion of both legs at one phase."""
    assert result is not None
    posed = result.at(dict.fromkeys(SIDES, phase), (0.0, 0.0), 0.0)
    assert posed is not None
    q = {s: posed[0][k] for k, s in enumerate(SEGMENTS)}
    left, right = (-cardan_zxy(multiply(conjugate(q[THIGH[side]]), q[SHANK[side]]))[0] for side in SIDES)
    assert left == pytest.approx(right, abs=1e-9)
    return float(left)


def test_the_better_side_is_the_one_that_moves_more_like_the_norm() -> None:
    notices = (stride(0, Leg("left", 0.5)), stride(1, Leg("right")))
    matches = reference().find("better", notices, dict)
    assert matches is not None
    assert matches.lead == "right"
    assert knee(matches, 0.73) == pytest.approx(float(walk.KNEE(0.74)), abs=np.radians(1.5))
    assert find_better_side({"left": Leg("left").curves()}, NORM) is None


def test_the_side_that_is_trained_is_not_the_better_one() -> None:
    notices = (stride(0, Leg("left", 0.5)), stride(1, Leg("right")))
    matches = reference("right").find("better", notices, dict)
    assert matches is not None
    assert matches.lead == "left"
    assert knee(matches, 0.73) == pytest.approx(0.5 * float(walk.KNEE(0.74)), abs=np.radians(1.0))


def test_it_is_the_mean_of_the_last_strides_that_count() -> None:
    strides = [stride(n, Leg("right", 0.2), counted=n != 3) for n in range(4)]
    strides += [stride(n, Leg("right", 1.0 if n % 2 else 0.8)) for n in range(4, 9)]
    strides += [stride(9, Leg("right", 5.0), counted=False), stride(8, Leg("right", 0.8))]
    matches = reference("left").find("better", tuple(strides), dict)
    assert knee(matches, 0.73) == pytest.approx(0.88 * float(walk.KNEE(0.74)), abs=np.radians(1.0))


def test_a_new_stride_changes_the_mean() -> None:
    result = reference("left")
    one = (stride(0, Leg("right", 0.5)),)
    first = result.find("better", one, dict)
    assert result.find("better", one, dict) is first
    second = result.find("better", (*one, stride(2, Leg("right", 1.0))), dict)
    assert knee(second, 0.73) > knee(first, 0.73) + np.radians(5)


def test_the_norm_walks_at_the_speed_of_the_last_strides() -> None:
    requests: list[float | None] = []

    def norm_at(speed_mps: float | None) -> dict[str, np.ndarray]:
        requests.append(speed_mps)
        bands = look_up_norms(40, None, speed_mps, 1.7).bands
        return {name: np.radians(band.mean_deg) for name, band in bands.items()}

    view = LiveReference(walk.BODY, norm_at, lambda: None)
    slow = tuple(stride(n, Leg("left"), speed_mps=0.41) for n in range(3))
    first = view.find("norm", slow[:2], dict)
    second = view.find("norm", slow, dict)
    assert requests == [None, pytest.approx(0.4)], "in steps, so that it does not waver"
    assert knee(first, 0.72) - knee(second, 0.72) > np.radians(12.0)
    crawling = tuple(stride(n, Leg("left"), speed_mps=0.2) for n in range(3))
    assert view.find("norm", crawling, dict) is None, "nobody in the reference walked as slowly"
    assert reference(norm={}).find("norm", (), dict) is None


def test_standing_angles_are_put_back_so_that_the_mirror_has_the_persons_own_posture() -> None:
    i = 70
    view = FeedFrame("erkf", {}, {n: float(np.degrees(x[i])) for n, x in raw_angles(zeroed=True).items()})
    result = find_standing_angles(moment_at(i), view.angles_deg)
    raw = {name: x[0] for name, x in raw_angles(zeroed=False).items()}
    for name, value in raw.items():
        assert result[name] == pytest.approx(value, abs=1e-6), name
    curves = {"knee_flexion": np.full(101, 0.3), "pelvis_obliquity": np.full(101, 0.1)}
    left = add_standing_angles(curves, {"knee_flexion_l": 0.05, "pelvis_obliquity": 0.02}, "left")
    assert left["knee_flexion"][0] == pytest.approx(0.35)
    assert left["pelvis_obliquity"][0] == pytest.approx(0.08)  # right up is positive, the left's own is not


def moment_at(i: int) -> FigureMoment:
    result: Picture = picture(i)
    assert result.pose is not None
    return read_moment(result, result.pose, FeedFrame("erkf", {}, {}))


def raw_angles(*, zeroed: bool) -> dict[str, np.ndarray]:
    """Angles of the walk by `sagittal.core.angles`, from the first sample as standing or not."""
    poses = pictures.POSES
    valid = dict.fromkeys(poses.q, poses.valid)
    whole = measure_angles(Orientations(poses.t_s, poses.rate_hz, poses.q, valid, "kinematic"), (0.0, 0.03))
    if zeroed:
        return dict(whole.angles)
    return {name: np.full(1, zero) for name, zero in whole.zero_offset.items()}
