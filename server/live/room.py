"""Who watches a session: browsers that each get the newest state and, in order, what happens once.

A browser that is too slow loses frames, never the others' time: state is replaced while it waits, and of what
happens once the oldest goes beyond `QUEUE`.
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
"""Strides, cues and notices kept for a browser that does not read: two minutes of walking."""
KEPT: Final = 60
"""Strides and cues that a new browser gets, as many as one that was there holds (web/static/js/live/feed.js):
the page's strip has the last 20 of a side that is trained alone, some of which do not count."""
STATES: Final = ("state", "feedback", "frame")
"""Kinds of which only the newest counts, in the order in which a new browser gets them."""


class StrideNumber(msgspec.Struct, frozen=True):
    """What names a stride in what is told of it."""

    n: int


_number = msgspec.json.Decoder(StrideNumber).decode


class BrowserQueue:
    """One browser's letter box."""

    def __init__(self) -> None:
        self._newest: dict[str, bytes] = {}
        self._once: deque[bytes] = deque(maxlen=QUEUE)
        self._wake = asyncio.Event()

    def put(self, kind: str, body: bytes) -> None:
        """Leave a message."""
        if kind in STATES:
            self._newest[kind] = body
        else:
            self._once.append(body)
        self._wake.set()

    async def take(self) -> list[bytes]:
        """Wait for messages and return all of them: what happened before where things stand now."""
        await self._wake.wait()
        self._wake.clear()
        state = self._newest.pop("state", None)
        rest = [self._newest.pop(kind) for kind in STATES if kind in self._newest]
        messages = [*([state] if state else []), *self._once, *rest]
        self._once.clear()
        return messages


class Room:
    """The browsers of one session and what one that comes later gets first."""

    def __init__(self) -> None:
        self.viewers: set[BrowserQueue] = set()
        self.picture: Picture | None = None
        self._newest: dict[str, bytes] = {}
        self._strides: dict[int, bytes] = {}
        self._cues: dict[int, bytes] = {}
        self._watchers: list[Callable[[Picture], None]] = []

    @property
    def is_empty(self) -> bool:
        """Whether nobody watches."""
        return not self.viewers and not self._watchers

    def clear(self) -> None:
        """Another take begins with nothing of the one before."""
        self.picture = None
        self._newest.clear()
        self._strides.clear()
        self._cues.clear()

    def say(self, kind: str, body: bytes) -> None:
        """Tell everybody."""
        if kind in STATES:
            self._newest[kind] = body
        for viewer in self.viewers:
            viewer.put(kind, body)

    def keep_stride(self, body: bytes) -> None:
        """Keep what was told last of a stride for those who come later."""
        _keep(self._strides, _number(body).n, body)

    def forget_strides(self) -> None:
        """Calibrated anew: what was told belongs to the old axes, and strides are counted from 0 again."""
        self._strides.clear()
        self._cues.clear()

    def keep_cue(self, k: int, body: bytes) -> None:
        """Keep the `k`th cue for those who come later."""
        _keep(self._cues, k, body)

    @property
    def strides(self) -> tuple[bytes, ...]:
        """What was told last of each of the last strides, in order."""
        return tuple(self._strides[k] for k in sorted(self._strides))

    def show(self, picture: Picture) -> None:
        """Hand on the figure."""
        self.picture = picture
        for watcher in tuple(self._watchers):
            watcher(picture)

    @contextmanager
    def viewing(self) -> Iterator[BrowserQueue]:
        """A browser, while it is there."""
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
        """Call `watcher` on the event loop with every new picture, first with the last one."""
        self._watchers.append(watcher)
        if self.picture is not None:
            watcher(self.picture)
        try:
            yield
        finally:
            self._watchers.remove(watcher)


def _keep(kept: dict[int, bytes], k: int, body: bytes) -> None:
    kept[k] = body
    while len(kept) > KEPT:
        del kept[min(kept)]
