"""Viewers of a session: each browser receives the latest state, and one-time events in order.

A slow browser loses frames without delaying the others: pending state is replaced, and beyond `QUEUE` the
oldest events are dropped.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

import msgspec

from sagittal.server.live.messages import Picture

QUEUE: Final = 200
"""Strides, cues and notices queued for a browser that does not read: two minutes of walking."""
KEPT: Final = 60
"""Strides and cues sent to a new browser, as many as a connected one holds (web/static/js/live/feed.js): the
page's strip shows the last 20 of a trained side, some of which may be excluded.
"""
STATES: Final = ("state", "feedback", "frame")
"""Kinds of which only the latest is sent, in the order for a new browser."""


class StrideNumber(msgspec.Struct, frozen=True):
    """Number that identifies a stride in messages about it."""

    n: int


_number = msgspec.json.Decoder(StrideNumber).decode


class BrowserQueue:
    """Outgoing messages of one browser."""

    def __init__(self) -> None:
        self._newest: dict[str, bytes] = {}
        self._once: deque[bytes] = deque(maxlen=QUEUE)
        self._wake = asyncio.Event()

    def put(self, kind: str, body: bytes) -> None:
        """Add a message."""
        if kind in STATES:
            self._newest[kind] = body
        else:
            self._once.append(body)
        self._wake.set()

    async def take(self) -> list[bytes]:
        """Wait for messages and return all of them: events before current states."""
        await self._wake.wait()
        self._wake.clear()
        state = self._newest.pop("state", None)
        states = [self._newest.pop(kind) for kind in STATES if kind in self._newest]
        messages = [*([state] if state else []), *self._once, *states]
        self._once.clear()
        return messages


class Room:
    """Browsers of one session, and the messages that a new one receives first."""

    def __init__(self) -> None:
        self.viewers: set[BrowserQueue] = set()
        self.picture: Picture | None = None
        self._newest: dict[str, bytes] = {}
        self._strides: dict[int, bytes] = {}
        self._cues: dict[int, bytes] = {}
        self._watchers: list[Callable[[Picture], None]] = []

    @property
    def is_empty(self) -> bool:
        """Whether there are no viewers."""
        return not self.viewers and not self._watchers

    def clear(self) -> None:
        """Reset everything for a new trial."""
        self.picture = None
        self._newest.clear()
        self._strides.clear()
        self._cues.clear()

    def say(self, kind: str, body: bytes) -> None:
        """Send a message to all browsers."""
        if kind in STATES:
            self._newest[kind] = body
        for viewer in self.viewers:
            viewer.put(kind, body)

    def keep_stride(self, body: bytes) -> None:
        """Store the latest message about a stride for browsers that join later."""
        _keep(self._strides, _number(body).n, body)

    def forget_strides(self) -> None:
        """Discard strides after a new calibration: they used the old axes, and numbering restarts at 0."""
        self._strides.clear()
        self._cues.clear()

    def keep_cue(self, k: int, body: bytes) -> None:
        """Store the `k`th cue for browsers that join later."""
        _keep(self._cues, k, body)

    @property
    def strides(self) -> tuple[bytes, ...]:
        """Latest message about each recent stride, in order."""
        return tuple(self._strides[k] for k in sorted(self._strides))

    def show(self, picture: Picture) -> None:
        """Forward a picture of the avatar."""
        self.picture = picture
        for watcher in tuple(self._watchers):
            watcher(picture)

    @contextmanager
    def viewing(self) -> Iterator[BrowserQueue]:
        """Context in which a browser is connected."""
        viewer = BrowserQueue()
        if "state" in self._newest:
            viewer.put("state", self._newest["state"])
        for k in sorted(self._strides):
            viewer.put("stride", self._strides[k])
        for k in sorted(self._cues):
            viewer.put("cue", self._cues[k])
        for kind in STATES[1:]:
            if kind in self._newest:
                viewer.put(kind, self._newest[kind])
        self.viewers.add(viewer)
        try:
            yield viewer
        finally:
            self.viewers.discard(viewer)

    @contextmanager
    def watching(self, watcher: Callable[[Picture], None]) -> Iterator[None]:
        """Call `watcher` on the event loop with every new picture, starting with the last one."""
        self._watchers.append(watcher)
        if self.picture is not None:
            watcher(self.picture)
        try:
            yield
        finally:
            self._watchers.remove(watcher)


def _keep(messages: dict[int, bytes], k: int, body: bytes) -> None:
    messages[k] = body
    while len(messages) > KEPT:
        del messages[min(messages)]
