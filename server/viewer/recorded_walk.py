"""Self-contained HTML export of a walk: viser's client with the recorded scene, without a server.

Registers itself as the export "walk", since drawing belongs to this package and exports to a lower one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from sagittal.server.export.content import ExportContent
from sagittal.server.export.kinds import DRAWN

if TYPE_CHECKING:
    from sagittal.core.body.poses import Poses

RATE_HZ: Final = 25.0
"""Frames per second, as in films."""

TITLE: Final = ("<title>Viser</title>", "<title>Sagittal</title>")
"""Title of the client and name of the file, without patient data."""


def write_walk(content: ExportContent) -> bytes:
    """Write the avatar of an analysis as HTML; raises SagittalError if there is nothing to draw."""
    return record_walk(content.poses)


def record_walk(poses: Poses) -> bytes:
    """Draw a walk frame by frame, followed from the right, with footprints and trails."""
    # a worker that draws nothing does not import viser
    from sagittal.server.viewer.client import silence
    from sagittal.server.viewer.motion import prepare_motion
    from sagittal.server.viewer.replay.replay_figure import ReplayFigure
    from sagittal.server.viewer.scene_server import start_scene_server, stop_scene_server

    motion = prepare_motion(poses)
    server = start_scene_server()
    try:
        figure = ReplayFigure(server, motion)
        recorded = server.get_scene_serializer()
        for t in np.arange(motion.t_s[0], motion.t_s[-1], 1.0 / RATE_HZ).tolist():
            figure.pose(t)
            recorded.insert_sleep(1.0 / RATE_HZ)
        page: str = recorded.as_html()
    finally:
        stop_scene_server(server)
    return silence(page.replace(*TITLE, 1)).encode()


DRAWN["walk"] = write_walk
