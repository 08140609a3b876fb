"""Live avatar compared with the replay of the same walk, and its footprints."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import viser
from viser._messages import SceneNodeUpdateMessage

from sagittal.core import rotation
from sagittal.core.angles import cardan_zxy
from sagittal.core.body.poses import Poses
from sagittal.core.frames import FOOT, SIDES, Segment
from sagittal.core.norms import adult_kinematics
from sagittal.server.viewer.batches import PALE
from sagittal.server.viewer.colours import GHOST, TINTS, to_linear_rgb
from sagittal.server.viewer.layout import FigureLayout
from sagittal.server.viewer.live.live_figure import LiveFigure
from sagittal.server.viewer.live.live_floor import PRINTS, TRAIL_S
from sagittal.server.viewer.live.live_path import LivePath
from sagittal.server.viewer.live.moment import FigureMoment
from sagittal.server.viewer.motion import prepare_motion
from sagittal.server.viewer.reference import SEGMENTS, ReferenceWalk
from sagittal.server.viewer.steps import PIECE_M
from tests.server import walk

RATE_HZ = 30.0
NORM = {name: np.radians(band.mean_deg) for name, band in adult_kinematics(None).bands.items()}


@pytest.fixture(scope="module")
def poses() -> Poses:
    return replace(walk.poses(12.0, RATE_HZ), method="erkf")


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    started = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield started
    started.stop()


class Scene:
    """A live figure and the nodes of its scene."""

    def __init__(self, server: viser.ViserServer) -> None:
        self.server = server
        self.figure = LiveFigure(server, walk.BODY)

    def __getitem__(self, name: str) -> viser.SceneNodeHandle:
        nodes = self.server.scene._handle_from_node_name
        # batches have the number of the drawing behind their name
        if f"/room{name}" in nodes:
            return nodes[f"/room{name}"]
        return nodes[next(n for n in reversed(nodes) if re.fullmatch(rf"/room{name}_\d+", n))]

    def place_of(self, name: str) -> np.ndarray:
        """Positions of the copies in the room, m."""
        return np.asarray(np.asarray(self[name].batched_positions) + np.array(self[name].position))

    def play(self, poses: Poses, until_s: float, since_s: float = 0.0) -> int:
        """Show all moments of a time; the index of the last."""
        times = np.flatnonzero((poses.t_s >= since_s) & (poses.t_s <= until_s)).tolist()
        for i in times:
            self.figure.show(moment(poses, i))
        return int(times[-1])


def moment(poses: Poses, i: int, *, valid: bool = True) -> FigureMoment:
    t_s = float(poses.t_s[i])
    return FigureMoment(
        t_s,
        tuple(poses.q),
        np.array([q[i] for q in poses.q.values()]),
        np.array([poses.p[s][i] for s in poses.q]),
        valid,
        poses.method,
        {s: bool(poses.contact[FOOT[s]][i]) for s in SIDES if FOOT[s] in poses.contact},
        {s: (t_s / walk.STRIDE_S + walk.PHASE[s]) % 1.0 for s in SIDES},
    )


def some(poses: Poses, *segments: Segment) -> Poses:
    return replace(
        poses,
        q={s: poses.q[s] for s in segments},
        p={s: poses.p[s] for s in segments},
        contact={s: c for s, c in poses.contact.items() if s in segments},
    )


ALL: tuple[Segment, ...] = SEGMENTS


@pytest.mark.parametrize("worn", [ALL, ("foot_l", "foot_r"), ("pelvis", "foot_r"), ("thigh_l", "shank_l")])
def test_a_moment_is_drawn_as_the_replay_draws_it(
    server: viser.ViserServer, poses: Poses, worn: tuple[Segment, ...]
) -> None:
    part = some(poses, *worn)
    replay, scene = prepare_motion(part), Scene(server)
    for i in (0, 37, 200):
        scene.figure.show(moment(part, i))
        for name, batch in replay.batches.items():
            np.testing.assert_allclose(scene.place_of(f"/{name}"), batch.position[i], atol=1e-6)
            np.testing.assert_allclose(scene[f"/{name}"].batched_wxyzs, batch.wxyz[i], atol=1e-6)


def test_before_the_first_pose_somebody_stands_in_grey_and_then_the_sides_have_their_colours(
    server: viser.ViserServer, poses: Poses
) -> None:
    scene = Scene(server)
    assert scene.figure.is_grey
    for name in ("thighs", "shanks", "foot_l", "toes_r", "trunk"):
        colours = np.asarray(scene[f"/{name}"].batched_colors)
        assert {tuple(c) for c in colours.tolist()} == {to_linear_rgb(TINTS[False]["body"])}
    for name in ("foot_l", "foot_r"):
        ankle = np.asarray(scene[f"/{name}"].batched_positions)
        np.testing.assert_allclose(ankle[:, 2], walk.BODY.ankle_height, atol=1e-6)
    scene.play(poses, 0.2)
    assert not scene.figure.is_grey
    colours = np.asarray(scene["/thighs"].batched_colors)
    assert tuple(colours[0]) == to_linear_rgb(TINTS[False]["left"])
    assert tuple(colours[1]) == to_linear_rgb(TINTS[False]["right"])


def test_what_is_stale_or_lost_stays_where_it_was_in_grey(server: viser.ViserServer, poses: Poses) -> None:
    scene = Scene(server)
    i = scene.play(poses, 3.0)
    held = np.asarray(scene["/thighs"].batched_positions).copy()
    scene.figure.show(moment(poses, i + 1, valid=False))
    assert scene.figure.is_grey
    np.testing.assert_array_equal(scene["/thighs"].batched_positions, held)
    scene.figure.show(moment(poses, i + 2))
    assert not scene.figure.is_grey
    scene.figure.set_stale()
    assert scene.figure.is_grey
    scene.figure.show(moment(poses, i + 3), late=True)
    assert scene.figure.is_grey
    scene.figure.wait()
    assert scene["/foot_l"].batched_positions[0][0] == scene["/foot_r"].batched_positions[0][0]


def test_the_trails_are_the_last_seconds_of_the_soles_way(server: viser.ViserServer, poses: Poses) -> None:
    scene = Scene(server)
    i = scene.play(poses, 11.0)
    pieces = np.asarray(scene["/trails"].points)
    q, p = (np.stack([source[s] for s in poses.q], axis=1) for source in (poses.q, poses.p))
    soles = FigureLayout(tuple(poses.q), walk.BODY, "").place(q, p).soles
    for side, drawn in zip(SIDES, np.split(pieces, 2), strict=True):
        observations = drawn[drawn[:, 0, 2] > -1.0]
        path = soles[side][: i + 1]
        late = path[poses.t_s[: i + 1] >= 11.0 - TRAIL_S - 0.2]
        assert 0.9 * TRAIL_S * 1.2 < np.ptp(observations[..., 0]) <= np.ptp(late[:, 0]) + PIECE_M
        assert np.linalg.norm(observations[:, 1] - observations[:, 0], axis=1).min() >= PIECE_M - 1e-6
        nearest = np.abs(observations[:, 1, None, 0] - path[None, :, 0]).min(axis=1)
        assert nearest.max() < 1e-5


@pytest.mark.parametrize("dark", [False, True])
def test_a_trail_has_the_colour_of_its_leg(server: viser.ViserServer, poses: Poses, dark: bool) -> None:
    scene = Scene(server)
    scene.figure = LiveFigure(server, walk.BODY, dark)
    scene.play(poses, 1.0)
    line = scene["/trails"]
    for side, own in zip(SIDES, np.split(np.asarray(line.colors), 2), strict=True):
        assert {tuple(c) for c in own.reshape(-1, 3).tolist()} == {to_linear_rgb(TINTS[dark][side])}
        part = scene["/thighs"].batched_colors[SIDES.index(side)]
        assert tuple(np.asarray(part).tolist()) == to_linear_rgb(TINTS[dark][side])


def test_a_trail_has_a_gap_where_poses_were_lost(server: viser.ViserServer, poses: Poses) -> None:
    scene = Scene(server)
    scene.play(poses, 4.0)
    scene.figure.show(moment(poses, int(4.5 * RATE_HZ), valid=False))
    scene.play(poses, 8.0, since_s=4.8)
    pieces = np.asarray(scene["/trails"].points)
    assert np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1).max() < 0.25


def test_prints_lie_where_the_replay_has_them(server: viser.ViserServer, poses: Poses) -> None:
    scene, replay = Scene(server), prepare_motion(replace(poses, method="erkf_smoothed"))
    scene.play(poses, 11.0)
    for side in SIDES:
        node = scene[f"/prints_{side}"]
        visible_values = np.asarray(node.batched_positions)[np.asarray(node.batched_scales) > 0]
        assert len(visible_values) == PRINTS
        known_position = replay.prints[side].position
        apart = np.linalg.norm(visible_values[:, None] - known_position[None], axis=-1)
        assert apart.min(axis=1).max() < 0.02
        assert len(set(apart.argmin(axis=1))) == PRINTS


def test_another_take_starts_with_an_empty_floor(server: viser.ViserServer, poses: Poses) -> None:
    scene = Scene(server)
    scene.play(poses, 8.0)
    scene.figure.show(moment(poses, 0))
    assert (np.asarray(scene["/trails"].points)[..., 2] < -1.0).all()
    assert np.asarray(scene["/prints_left"].batched_scales).sum() <= 1


@pytest.mark.parametrize("sway_m", [0.0, 0.04])
def test_the_camera_follows_a_walk_without_delay_and_without_its_sway(sway_m: float) -> None:
    path = LivePath()
    t = np.arange(300) / RATE_HZ
    place = np.stack((1.2 * t, sway_m * np.sin(2 * np.pi * t / 1.2)), axis=1)
    values = np.array(
        [path.push(s, x, y, 3.0)[:2] for s, (x, y) in zip(t.tolist(), place.tolist(), strict=True)]
    )
    steady = values[90:]
    np.testing.assert_allclose(steady[:, 0], place[90:, 0], atol=0.02)
    assert np.abs(steady[:, 1]).max() <= 0.15 * sway_m + 1e-9


def test_a_heading_may_turn_through_the_back() -> None:
    path = LivePath()
    turned = [(3.0 + 0.01 * k + np.pi) % (2 * np.pi) - np.pi for k in range(90)]
    frames = [path.push(k / RATE_HZ, 0.0, 0.0, x) for k, x in enumerate(turned)]
    assert frames[-1][2] == pytest.approx(3.89, abs=0.02)


FEET = ("foot_l", "foot_r")


def ghosts_of(scene: Scene) -> set[str]:
    """Parts of the ghost that is in the scene."""
    names = (re.fullmatch(r"/room/ghost_(\w+)_\d+", n) for n in scene.server.scene._handle_from_node_name)
    return {result[1] for result in names if result}


def ghost_of(scene: Scene, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Positions in the room and orientations of a part of the ghost."""
    return scene.place_of(f"/ghost_{name}"), np.asarray(scene[f"/ghost_{name}"].batched_wxyzs, float)


def test_the_ghost_of_the_norm_has_the_angles_of_the_norm_beside_the_person(
    server: viser.ViserServer, poses: Poses
) -> None:
    scene = Scene(server)
    scene.figure.set_reference(ReferenceWalk(NORM, walk.BODY))
    for i in range(120, 150, 4):
        now = moment(poses, i)
        scene.figure.show(now)
        position, (pelvis,) = ghost_of(scene, "pelvis")
        thighs, shanks = (ghost_of(scene, name)[1] for name in ("thighs", "shanks"))
        soles, feet = (np.concatenate(x) for x in zip(*(ghost_of(scene, n) for n in FEET), strict=True))
        np.testing.assert_allclose(position[0, :2], now.p[now.segments.index("pelvis"), :2], atol=1e-5)
        for k, side in enumerate(SIDES):
            row = round(100 * float(now.phase[side] or 0.0))
            for name, proximal, distal, sign in (
                ("hip_flexion", pelvis, thighs[k], 1.0),
                ("knee_flexion", thighs[k], shanks[k], -1.0),
                ("ankle_dorsiflexion", shanks[k], feet[k], 1.0),
            ):
                angle = sign * cardan_zxy(rotation.multiply(rotation.conjugate(proximal), distal))[0]
                assert angle == pytest.approx(NORM[name][row], abs=1e-5), (side, name)
        lowest = min(
            (p + rotation.rotate(r, np.array([x * walk.BODY.foot, -walk.BODY.ankle_height, 0.0])))[2]
            for p, r in zip(soles, feet, strict=True)
            for x in (-0.21, 0.53)
        )
        assert lowest == pytest.approx(0.0, abs=1e-5)


def test_the_ghost_is_pale_and_goes_when_it_is_switched_off_or_no_phase_is_known(
    server: viser.ViserServer, poses: Poses
) -> None:
    scene = Scene(server)
    scene.figure.set_reference(ReferenceWalk(NORM, walk.BODY))
    scene.figure.show(moment(poses, 60))
    for name in ("thighs", "pelvis", "foot_l"):
        node = scene[f"/ghost_{name}"]
        assert {tuple(c) for c in np.asarray(node.batched_colors).tolist()} == {to_linear_rgb(GHOST[False])}
        assert node.opacity == PALE
    assert ghosts_of(scene) == {"thighs", "shanks", *FEET, "toes_l", "toes_r", "pelvis"}  # no second trunk
    scene.figure.show(replace(moment(poses, 61), phase={}))
    assert (ghost_of(scene, "thighs")[0][:, 2] < -50.0).all()
    scene.figure.show(replace(moment(poses, 62), phase={"right": 0.25, "left": None}))
    assert (ghost_of(scene, "thighs")[0][:, 2] > -0.2).all()
    scene.figure.set_reference(None)
    scene.figure.show(moment(poses, 63))
    assert ghosts_of(scene) == set()


def test_the_ghost_walks_where_the_person_walks(server: viser.ViserServer, poses: Poses) -> None:
    about = rotation.about(2, 2.0)
    turned = replace(
        poses,
        q={s: rotation.multiply(about, q) for s, q in poses.q.items()},
        p={s: rotation.rotate(about, p) for s, p in poses.p.items()},
    )
    scene = Scene(server)
    scene.figure.set_reference(ReferenceWalk(NORM, walk.BODY))
    scene.play(turned, 5.0)
    pelvis = ghost_of(scene, "pelvis")[1][0]
    assert rotation.yaw(pelvis) == pytest.approx(2.0, abs=0.12)  # the norm's own pelvis turns by ±4°


@pytest.mark.bench
def test_a_moment_costs_little(server: viser.ViserServer, poses: Poses) -> None:
    layout = FigureLayout(tuple(poses.q), walk.BODY, "erkf")
    q, p = (np.stack([source[s][:1] for s in poses.q], axis=1) for source in (poses.q, poses.p))
    took = []
    for _ in range(200):
        began = time.thread_time()
        layout.place(q, p)
        took.append(time.thread_time() - began)
    assert np.median(took) <= 0.4e-3


def test_who_turns_back_stays_in_the_picture() -> None:
    path = LivePath()
    for i in range(400):
        t = i / 50
        x = 1.2 * (t if t < 4 else 8 - t)
        seen_x, seen_y, _ = path.push(t, x, 0.0, 0.0)
        assert np.hypot(seen_x - x, seen_y) < 0.31


@pytest.mark.parametrize(("ghost", "messages", "floats"), [(False, 13, 250), (True, 20, 330)])
def test_a_frame_is_a_few_small_messages(
    server: viser.ViserServer, poses: Poses, ghost: bool, messages: int, floats: int
) -> None:
    """Poses, floor and room; trails, which are of fixed size, are sent at every third frame only."""
    scene = Scene(server)
    scene.figure.set_reference(ReferenceWalk(NORM, walk.BODY) if ghost else None)
    scene.play(poses, 2.0)
    sent = server._websock_server._broadcast_buffer.message_from_id
    initial_names = set(sent)
    scene.figure.show(moment(poses, 61))
    new = [m for k, m in sent.items() if k not in initial_names]
    poses_sent = [
        m.updates for m in new if isinstance(m, SceneNodeUpdateMessage) and "batched_wxyzs" in m.updates
    ]
    assert len(poses_sent) >= 10
    assert len(new) <= messages
    assert sum(np.size(x) for updates in poses_sent for x in updates.values()) <= floats
