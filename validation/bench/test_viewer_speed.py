"""Cost of a 3D view in the web process at 30 frames/s, live and replay, by viewers."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pytest
import viser

from sagittal.core.norms import adult_kinematics
from sagittal.server.viewer.ghost import match_ghost
from sagittal.server.viewer.live.live_figure import LiveFigure
from sagittal.server.viewer.live.live_reference import LiveReference
from sagittal.server.viewer.live_watch import LiveWatch
from sagittal.server.viewer.motion import prepare_motion
from sagittal.server.viewer.replay.replay_figure import ReplayFigure
from tests.server import walk
from tests.server.viewer.pictures import POSES, RATE_HZ, picture
from validation.figures import record_goal

PICTURES, WINDOWS = round(RATE_HZ), 8
"""Of a window of walking, a second; how many windows: the first is for settling."""
NO_DEARER: Final = 1.6
"""Live / replay: measured 1.1 to 1.3. The aim is 4 % of a core for a figure that somebody looks at: measured
3.4 to 3.7 % on a busy machine, 2.2 % of it to pose; the replay 2.9 %. Each further viewer: 0.5 %."""

DRAIN = """
import sys, threading, viser
from websockets.sync.client import connect
def drain():
    with connect(f"ws://127.0.0.1:{sys.argv[1]}", subprotocols=[f"viser-v{viser.__version__}"], max_size=None,
                 compression=None, proxy=None) as ws:
        ws.recv()
        sys.stdout.write("ready\\n")  # at once: what two threads print may mingle
        sys.stdout.flush()
        for _ in ws: pass
for _ in range(int(sys.argv[2])): threading.Thread(target=drain).start()
"""
"""Browsers that read everything, in a process of their own."""


@dataclass(frozen=True)
class Cost:
    """Shares of a core: of the whole process, and of the thread that poses."""

    process: float
    posing: float


@contextmanager
def watched(server: viser.ViserServer, viewers: int) -> Iterator[None]:
    with subprocess.Popen(
        [sys.executable, "-c", DRAIN, str(server.get_port()), str(viewers)], stdout=subprocess.PIPE
    ) as browsers:
        try:
            assert browsers.stdout is not None
            for _ in range(viewers):
                assert browsers.stdout.readline() == b"ready\n"
            yield
        finally:
            browsers.kill()


def cost(show: Callable[[int], object], first: int) -> Cost:
    """CPU time per second of showing 30 frames a second for a window, from the picture `first` on."""
    process, thread, began = time.process_time(), time.thread_time(), time.perf_counter()
    for i in range(PICTURES):
        show(first + i)
        time.sleep(max(0.0, began + (i + 1) / RATE_HZ - time.perf_counter()))
    took = time.perf_counter() - began
    return Cost((time.process_time() - process) / took, (time.thread_time() - thread) / took)


@contextmanager
def view() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield server
    finally:
        server.stop()


def live(server: viser.ViserServer) -> Callable[[int], object]:
    """Live avatar with the norm, fed like by the hub."""
    norm = {name: np.radians(band.mean_deg) for name, band in adult_kinematics(None).bands.items()}
    watch = LiveWatch(
        LiveFigure(server, walk.BODY),
        LiveReference(walk.BODY, lambda _: norm, lambda: None),
        ghost=lambda: "norm",
        strides=lambda: (),
        watched=lambda: True,
    )
    pictures = [picture(i) for i in range(len(POSES.t_s))]
    return lambda i: watch.see(pictures[i])


def replay(server: viser.ViserServer) -> Callable[[int], object]:
    """The same walk replayed with another one over it."""
    motion = prepare_motion(replace(walk.poses(12.0, 60.0), method="erkf_smoothed"))
    ghost = match_ghost(motion, walk.strides(), motion, walk.strides())
    figure = ReplayFigure(server, replace(motion, ghosts={"visit": lambda: ghost}))
    figure.set_ghost("visit")
    return lambda i: figure.pose(i / RATE_HZ)


@pytest.mark.parametrize("viewers", [1, 4])
def test_a_live_figure_costs_little_more_than_a_replayed_one(
    viewers: int,
) -> None:
    with view() as ours, view() as theirs, watched(ours, viewers), watched(theirs, viewers):
        show_live, show_replay = live(ours), replay(theirs)
        # one window of each after the other: a machine that is slower for a while is slower for both
        pairs = [(cost(show_live, i * PICTURES), cost(show_replay, i * PICTURES)) for i in range(WINDOWS)][1:]
    ratio = float(np.median([a.process / b.process for a, b in pairs]))
    # other work on this machine only ever adds
    a, b = (min(costs, key=lambda x: x.process) for costs in zip(*pairs, strict=True))
    sys.stdout.write(
        f"{viewers} viewers: live {a.process:.2%} of a core (posing {a.posing:.2%}), replay {b.process:.2%} "
        f"(posing {b.posing:.2%}); live / replay {ratio:.2f}\n"
    )
    if viewers == 1:
        record_goal("3D figure of a live take at 30 Hz, of a core", 4.0, 100.0 * a.process, "%")
    assert ratio <= NO_DEARER


def test_what_a_picture_takes_to_be_posed() -> None:
    with view() as server:
        show = live(server)
        took = []
        for i in range(300):
            began = time.thread_time()
            show(i)
            took.append(time.thread_time() - began)
    median = float(np.median(took[30:]))
    sys.stdout.write(f"a live picture with ghost, trails and prints: median {1e3 * median:.2f} ms\n")
    assert median <= 10e-3  # a third of the time between two pictures: only gross losses


def test_a_view_of_ten_minutes_is_ready_soon() -> None:
    took = {}
    for lasts_s in (60.0, 600.0):
        poses = replace(walk.poses(lasts_s), method="erkf_smoothed")
        with view() as server:
            began = time.thread_time()
            ReplayFigure(server, prepare_motion(poses))
            took[lasts_s] = time.thread_time() - began
    sys.stdout.write(f"a view of one minute {took[60.0]:.3f} s, of ten {took[600.0]:.3f} s\n")
    assert took[600.0] <= 15 * took[60.0]
    assert took[600.0] <= 1.0  # measured 0.15 to 0.25 s: only gross losses
