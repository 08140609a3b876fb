"""Open 3D views: one viser server each, on its own socket, stopped after a time without viewers.

Separate servers isolate patients by design: there is no shared scene. A replay view belongs to the sign-in
that opened it; a live view is shared by all users with access. The registry is in memory; each of several web
servers has the views assigned to it by their ids (nodes/pins.py).
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import time
import weakref
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import viser

from sagittal.core.errors import EstimationError
from sagittal.server.auth.roles import Action, Role, is_permitted
from sagittal.server.viewer.live.live_figure import LiveFigure
from sagittal.server.viewer.motion import ReplayMotion
from sagittal.server.viewer.replay.replay_figure import ReplayFigure
from sagittal.server.viewer.scene_server import socket_of, start_scene_server, stop_scene_server

IDLE_S = 30.0
"""Views without viewers are stopped after this time; reloading a page takes much less."""

PATIENCE_S = 4.0
"""Time a relay waits for its view: the page loads the 3D client while the view is opening. Viser's client
gives up a second later; the page then reloads it (replay.js).
"""

MOST_NAMES = 8
"""Names given to one view by pages: those of the last few loads of a tab."""

SWEEP_S = 1.0
MAX_VIEWS = 48
"""Maximum number of open views, about 15 MB each for different 10 min walks."""

Key = tuple[str, ...]
Drawn = TypeVar("Drawn", ReplayFigure, LiveFigure)


def new_id() -> str:
    """An unguessable id: 32 hex digits."""
    return secrets.token_hex(16)


@dataclass(eq=False)
class FigureView(Generic[Drawn]):
    """One avatar in one viser server.

    Parameters
    ----------
    id : unguessable, part of the URL. key : content and audience. session_id : its session.
    login_id : permitted sign-in, None = all whose role permits `action`. viewers : open connections.
    left_at : monotonic time since when there are none. let_go : called once at its end.
    """

    id: str
    key: Key
    session_id: str
    login_id: str | None
    action: Action
    server: viser.ViserServer
    figure: Drawn
    viewers: int = 0
    left_at: float = field(default_factory=time.monotonic)
    let_go: Callable[[], None] | None = None

    @property
    def socket(self) -> Path:
        """Socket of the viser server."""
        return socket_of(self.server)

    @contextlib.contextmanager
    def keep_open(self) -> Iterator[None]:
        """Keep the view open during a connection."""
        self.viewers += 1
        try:
            yield
        finally:
            self.viewers -= 1
            self.left_at = time.monotonic()


class FigureViews:
    """Registry of this process's open views; used from its event loop only.

    Parameters
    ----------
    idle_s : lifetime of a view without viewers. limit : maximum number of views. make_id : generates ids.
    """

    def __init__(
        self, idle_s: float = IDLE_S, limit: int = MAX_VIEWS, make_id: Callable[[], str] = new_id
    ) -> None:
        self._idle_s, self._limit, self._make_id = idle_s, limit, make_id
        self._views: dict[str, FigureView[Any]] = {}
        self._motions: weakref.WeakValueDictionary[str, ReplayMotion] = weakref.WeakValueDictionary()
        self._opening = asyncio.Lock()
        self._awaited: dict[str, asyncio.Event] = {}

    def __len__(self) -> int:
        return len(set(self._views.values()))

    def find(self, view_id: str, login_id: str, role: Role) -> FigureView[Any] | None:
        """Return a view to users with access, None to others."""
        view = self._views.get(view_id)
        if view is None or view.login_id not in (None, login_id) or not is_permitted(role, view.action):
            return None
        return view

    async def find_soon(self, view_id: str, login_id: str, role: Role) -> FigureView[Any] | None:
        """Like `find`, but wait for a view that is not open yet, up to a timeout."""
        if view_id not in self._views:
            opened = self._awaited.setdefault(view_id, asyncio.Event())
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(opened.wait(), PATIENCE_S)
            self._awaited.pop(view_id, None)
        return self.find(view_id, login_id, role)

    async def open(
        self,
        login_id: str,
        tab: str,
        session_id: str,
        source: str,
        load: Callable[[], ReplayMotion],
        *,
        dark: bool = False,
        t_s: float = 0.0,
        name: str | None = None,
    ) -> FigureView[ReplayFigure]:
        """Return the view of one browser tab on one source, creating it if necessary.

        Parameters
        ----------
        source : id of the displayed analysis; `load` reads and prepares it and is called in a thread.
        t_s : time shown first. name : additional id generated by the page.

        Raises
        ------
        EstimationError
            `too_many_views` if the limit is reached and every view has viewers.
        """
        async with self._opening:
            view = self._known((login_id, tab, source))
            if view is not None:
                view.figure.pose(t_s)
                self._enter(name, view)
                return view
            await self._make_room()
            motion = self._motions.get(source)
            if motion is None:
                motion = await asyncio.to_thread(load)
                self._motions[source] = motion
            server, figure = await asyncio.to_thread(
                _start, lambda server: ReplayFigure(server, motion, dark, t_s)
            )
            view = self._add(
                (login_id, tab, source), session_id, login_id, Action.READ_RESULT, server, figure
            )
            self._enter(name, view)
            return view

    async def open_live(
        self,
        session_id: str,
        theme: str,
        draw: Callable[[viser.ViserServer], LiveFigure],
        attend: Callable[[FigureView[LiveFigure]], None],
    ) -> FigureView[LiveFigure]:
        """Return the shared view of a live session, creating it if necessary.

        Parameters
        ----------
        draw : creates the avatar; called in a thread. attend : called with a new view, on the event loop.

        Raises
        ------
        EstimationError
            `too_many_views`, like `open`.
        """
        async with self._opening:
            key = ("live", session_id, theme)
            view = self._known(key)
            if view is None:
                await self._make_room()
                server, figure = await asyncio.to_thread(_start, draw)
                view = self._add(key, session_id, None, Action.RUN_LIVE, server, figure)
                attend(view)
            return view

    async def sweep(self) -> None:
        """Stop all views that have been idle for too long."""
        now = time.monotonic()
        for view in set(self._views.values()):
            if view.viewers == 0 and now - view.left_at >= self._idle_s:
                await self._stop(view)

    async def close(self) -> None:
        """Stop all views."""
        for view in set(self._views.values()):
            await self._stop(view)

    @contextlib.asynccontextmanager
    async def run(self) -> AsyncIterator[FigureViews]:
        """Sweep in the background; stop all views at the end."""
        sweeper = asyncio.create_task(self._sweep_for_ever())
        try:
            yield self
        finally:
            sweeper.cancel()
            await asyncio.gather(sweeper, return_exceptions=True)
            await self.close()

    async def _sweep_for_ever(self) -> None:
        while True:
            await asyncio.sleep(SWEEP_S)
            await self.sweep()

    def _known(self, key: Key) -> FigureView[Any] | None:
        for view in self._views.values():
            if view.key == key:
                view.left_at = time.monotonic()
                return view
        return None

    def _add(
        self,
        key: Key,
        session_id: str,
        login_id: str | None,
        action: Action,
        server: viser.ViserServer,
        figure: Drawn,
    ) -> FigureView[Drawn]:
        view = FigureView(self._make_id(), key, session_id, login_id, action, server, figure)
        self._views[view.id] = view
        return view

    def _enter(self, name: str | None, view: FigureView[Any]) -> None:
        """Register a view under a name, unless it is in use."""
        if name is None or self._views.setdefault(name, view) is not view:
            return
        names = [
            alias for alias, registered in self._views.items() if registered is view and alias != view.id
        ]
        for old in names[:-MOST_NAMES]:
            del self._views[old]
        if name in self._awaited:
            self._awaited[name].set()

    async def _make_room(self) -> None:
        if len(self) < self._limit:
            return
        unwatched = [v for v in self._views.values() if v.viewers == 0]
        if not unwatched:
            raise EstimationError(
                "too_many_views",
                f"{self._limit} 3D views are open, the most this server keeps; close one and try again.",
            )
        await self._stop(min(unwatched, key=lambda v: v.left_at))

    async def _stop(self, view: FigureView[Any]) -> None:
        self._views = {name: registered for name, registered in self._views.items() if registered is not view}
        if view.let_go is not None:
            view.let_go()
        await asyncio.to_thread(stop_scene_server, view.server)


def _start(draw: Callable[[viser.ViserServer], Drawn]) -> tuple[viser.ViserServer, Drawn]:
    """Start a viser server and draw the avatar in it."""
    server = start_scene_server()
    try:
        return server, draw(server)
    except BaseException:
        stop_scene_server(server)
        raise
