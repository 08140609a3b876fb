"""Displays the estimator's poses of a session in one live avatar while it is being viewed.

Pictures are shown as they arrive, only the latest; after half a second without one the avatar turns grey.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Final, cast

import msgspec
import numpy as np

from sagittal.core.frames import SIDES, SUFFIX, Segment, Side
from sagittal.server.live.messages import STALE_S, FigurePose, Picture
from sagittal.server.viewer.live.live_figure import LiveFigure
from sagittal.server.viewer.live.live_reference import LiveReference, find_standing_angles
from sagittal.server.viewer.live.moment import FigureMoment

log = logging.getLogger(__name__)

TICK_S: Final = 0.1
"""Interval of checks for silence."""


class FeedFrame(msgspec.Struct, frozen=True):
    """The fields of a frame message (server/live/wire.py) used here."""

    method: str
    phase: dict[str, float | None]
    angles_deg: dict[str, float | None]


_shown = msgspec.json.Decoder(FeedFrame).decode


class LiveWatch:
    """Connects a session's pictures to one avatar; runs on the event loop.

    Parameters
    ----------
    ghost : returns the therapist's current choice. strides : returns the latest stride messages.
    watched : returns whether the view has viewers.
    """

    def __init__(
        self,
        figure: LiveFigure,
        reference: LiveReference,
        *,
        ghost: Callable[[], object],
        strides: Callable[[], tuple[bytes, ...]],
        watched: Callable[[], bool],
    ) -> None:
        self._figure, self._reference = figure, reference
        self._ghost, self._strides, self._watched = ghost, strides, watched
        self._newest: Picture | None = None
        self._at = -np.inf
        self._is_shown = True
        self._take: str | None = None
        self._failed = False

    def see(self, picture: Picture) -> None:
        """Receive the latest picture and show it if there are viewers."""
        self._newest, self._at, self._is_shown = picture, time.monotonic(), False
        if self._watched():
            self._show(picture)

    async def run(self) -> None:
        """Check for outdated data and new viewers until cancelled."""
        while True:
            await asyncio.sleep(TICK_S)
            self.look()

    def look(self) -> None:
        """Turn outdated data grey; show a picture received without viewers."""
        if self._newest is None or not self._watched():
            return
        if not self._is_shown:
            self._show(self._newest)
        if time.monotonic() - self._at > STALE_S:
            self._figure.set_stale()

    def _show(self, picture: Picture) -> None:
        """Show a picture; errors of the avatar must not affect the trial."""
        self._is_shown = True
        try:
            self._pose(picture)
            self._failed = False
        except Exception:
            if not self._failed:
                log.exception("the live figure of take %s could not be shown", picture.take)
            self._failed = True
            self._at = -np.inf  # the displayed pose is no longer current

    def _pose(self, picture: Picture) -> None:
        if picture.take != self._take:
            self._take = picture.take
            self._figure.wait()
        if picture.pose is None:
            if picture.stage == "running":
                self._figure.set_stale()
            else:
                self._figure.wait()
            return
        # the body lacks its closing brace (messages.Picture)
        feed_frame = _shown(picture.body + b"}")
        moment = read_moment(picture, picture.pose, feed_frame)
        self._figure.set_reference(
            self._reference.find(
                self._ghost(), self._strides(), lambda: find_standing_angles(moment, feed_frame.angles_deg)
            )
        )
        late = picture.delay_s is None or picture.delay_s > STALE_S
        self._figure.show(moment, late=late)


def read_moment(picture: Picture, pose: FigurePose, feed_frame: FeedFrame) -> FigureMoment:
    """Return poses and phases of a picture; phases in `feed_frame` are in %, the result is 0 to 1."""
    phase = {side: feed_frame.phase.get(SUFFIX[side]) for side in SIDES}
    return FigureMoment(
        t_s=picture.t_s,
        segments=cast("tuple[Segment, ...]", tuple(pose.segments)),
        q=np.frombuffer(pose.q, np.float32).reshape(-1, 4).astype(np.float64),
        p=np.frombuffer(pose.p, np.float32).reshape(-1, 3).astype(np.float64),
        valid=pose.valid,
        method=feed_frame.method,
        contact={cast("Side", side): on for side, on in pose.contact.items()},
        phase={side: None if x is None else x / 100.0 for side, x in phase.items()},
    )
