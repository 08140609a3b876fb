"""The routes of the 3D replay: the viewer page, the pipe to its viser server, and the time cursor.

    WS  /sessions/{sid}/replay?tab=…&dark=…&t=…&view=…   the time cursor; the page around owns the clock
            t = the moment shown first; view = 32 hexadecimal digits that the page made up, by which it may
            load the client and its pipe at once, while the view is being opened
            sends {"t": seconds}, true|false for one of "dark", "follow" (the person, else the whole walk
            is in the picture) and "ground" (footprints and trails), {"look": "right" or another of VIEWS in
            room.py} or {"ghost": "norm" or another of GhostName in motion.py, null for none}, answered by
            {"ghost": what is shown}, null where there is no such walk
            first answer {"view": id, "src": "/views/<id>/", "start_s", "duration_s",
            "placed": positions are where the person was, "measured": sensors support all of the figure,
            "hidden": segments without a pose}, which are not drawn,
            then {"t": shown, "valid": bool} for every {"t"}
    GET /views/{view}/   for an iframe: leads to viser's own client page, which takes this address again
    GET /views/client/{version}   that page, the same for all views, which browsers therefore keep
    WS  /views/{view}    the pipe; the client finds it from its own address
    The document tells the page around: "drawn" when a figure is to be seen, "no-3d" where there is no WebGL

A view can be seen by the sign-in that opened it only.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import math
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, cast

from fastapi import APIRouter, FastAPI, Query, Request, WebSocket
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from sqlalchemy import Connection
from starlette.status import WS_1008_POLICY_VIOLATION
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import WebSocketException

from sagittal.core.errors import SagittalError
from sagittal.core.formats.json_tree import read_json
from sagittal.server.auth.access import find_end, opens, require, wait_for_end
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.context import State, state_of
from sagittal.server.http.carrying import carry_messages
from sagittal.server.http.compression import accepts
from sagittal.server.http.headers import KEPT
from sagittal.server.http.problems import Problem, as_problem
from sagittal.server.report.files.bundle import read_poses
from sagittal.server.report.view.no_figure import explain_no_figure
from sagittal.server.results import analyses, comparisons, edit_log
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.viewer.client import client_page, client_version, find_packed_page
from sagittal.server.viewer.ghost import match_ghost
from sagittal.server.viewer.motion import GhostName, ReplayMotion, prepare_motion
from sagittal.server.viewer.pipe import (
    ViewActivity,
    connect_to_viser,
    find_subprotocols,
    is_allowed,
)
from sagittal.server.viewer.replay.replay_figure import ReplayFigure
from sagittal.server.viewer.replay.replay_reference import find_references
from sagittal.server.viewer.room import VIEWS, ViewName
from sagittal.server.viewer.views import FigureView, FigureViews, new_id

CONTENT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; worker-src blob:; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; connect-src 'self' data:; "
    "frame-ancestors 'self'"
)
"""What viser's single-file client needs, and nothing from elsewhere.

`wasm-unsafe-eval` compiles the zstd decoder that unpacks the client and its messages; `blob:` is the worker
that holds the websocket. Strings are never evaluated (`client.py` keeps the one module that would out).
"""

_GONE = 4404
"""Close code: the view is not there (any more); the page around should connect again."""

_SWITCHES: Mapping[str, Callable[[ReplayFigure, bool], None]] = {
    "dark": ReplayFigure.set_dark,
    "follow": ReplayFigure.set_follow,
    "ground": ReplayFigure.set_ground,
}

Reader = Annotated[Identity, require(Action.READ_RESULT)]


@contextlib.asynccontextmanager
async def open_views(app: FastAPI) -> AsyncIterator[None]:
    """Keep the figures that are looked at in `app.state.views` while the block runs."""
    nodes = cast("State", app.state).nodes
    async with FigureViews(make_id=lambda: nodes.make_id_here(new_id)).run() as views:
        app.state.views = views
        yield


router = APIRouter(include_in_schema=False)


@router.get("/views/{view_id}/")
def page(view_id: str, who: Reader, request: Request) -> RedirectResponse:
    """Lead to the document of the 3D view, which learns from its fragment which view it shows."""
    if _find(request, view_id, who) is None:
        raise Problem(404, "view_not_found", "This 3D view has ended. Reload the session page.")
    return RedirectResponse(
        f"/views/client/{client_version()}#{view_id}", headers={"Cache-Control": "no-store"}
    )


@router.get("/views/client/{version}", dependencies=[require(Action.LOAD_ASSET)])
def client(version: str, request: Request) -> Response:
    """The document of every 3D view; the address of an earlier version gets the present one."""
    kept = KEPT if version == client_version() else "no-cache"
    headers = {"Content-Security-Policy": CONTENT_POLICY, "Cache-Control": kept, "Vary": "Accept-Encoding"}
    packed = find_packed_page() if accepts("br", request.headers.get("accept-encoding", "")) else None
    if packed is None:
        return HTMLResponse(client_page(), headers=headers)
    return HTMLResponse(packed, headers={**headers, "Content-Encoding": "br"})


@router.websocket("/views/{view_id}")
async def pipe(ws: WebSocket, view_id: str, who: Reader) -> None:
    """Carry viser's messages."""
    view = await _views(ws).find_soon(view_id, who.login_id, who.role)
    if view is not None:
        view = await asyncio.to_thread(_find, ws, view_id, who)
    if view is None:
        await _say_gone(ws)
        return
    with view.keep_open():
        try:
            up = await connect_to_viser(view.socket, find_subprotocols(ws))
        except (OSError, WebSocketException):
            await _say_gone(ws)
            return
        async with up:
            await ws.accept(subprotocol=up.subprotocol)
            end = wait_for_end(functools.partial(find_end, ws, sid=view.session_id))
            await carry_messages(ws, up, admits=is_allowed, until=end)


def _find(connection: Request | WebSocket, view_id: str, who: Identity) -> FigureView[Any] | None:
    """A view that this person may look at and whose session may be opened."""
    view = _views(connection).find(view_id, who.login_id, who.role)
    return view if view is not None and opens(connection, who, {"sid": view.session_id}) else None


async def _say_gone(ws: WebSocket) -> None:
    """Close with a code of our own, which needs an accepted connection."""
    await ws.accept(subprotocol=next(iter(find_subprotocols(ws)), None))
    await ws.close(_GONE, "view_not_found")


@router.websocket("/sessions/{sid}/replay")
async def replay(
    ws: WebSocket,
    sid: str,
    who: Reader,
    tab: Annotated[str, Query(max_length=64)] = "",
    dark: bool = False,
    ghost: Annotated[str | None, Query(max_length=64)] = None,
    t: Annotated[float, Query(allow_inf_nan=False)] = 0.0,
    view: Annotated[str | None, Query(pattern="^[0-9a-f]{32}$")] = None,
) -> None:
    """Open the view of this browser tab and let the page move its cursor; `ghost` = another visit over it."""
    await ws.accept()
    try:
        opened = await _open(ws, sid, who, ghost, tab=tab, dark=dark, t_s=t, name=view)
    except (Problem, SagittalError) as error:
        problem = as_problem(error)
        await ws.send_json({"error": {"code": problem.code, "detail": problem.detail}})
        await ws.close(_GONE, problem.code)
        return
    logins = state_of(ws).logins
    name = view if view and _views(ws).find(view, who.login_id, who.role) is opened else opened.id
    with opened.keep_open():
        motion = opened.figure.motion
        answer = {
            "view": name,
            "src": f"/views/{name}/",
            "start_s": float(motion.t_s[0]),
            "duration_s": motion.duration_s,
            "placed": motion.placed,
            "measured": motion.measured,
            "hidden": motion.hidden,
        }
        activity = ViewActivity(lambda: logins.touch(who.login_id))
        cursor = asyncio.create_task(_follow(ws, opened, activity, answer))
        over = asyncio.create_task(wait_for_end(functools.partial(find_end, ws)))
        await asyncio.wait((cursor, over), return_when=asyncio.FIRST_COMPLETED)
        ended = over.done()
        for task in (cursor, over):
            task.cancel()
        await asyncio.gather(cursor, over, return_exceptions=True)
        if ended:
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await ws.close(WS_1008_POLICY_VIOLATION, over.result())


async def _open(
    ws: WebSocket, sid: str, who: Identity, other: str | None, *, tab: str, **shown_first: Any
) -> FigureView[ReplayFigure]:
    state = state_of(ws)
    db, reviewed = state.db, state.reviewed

    def latest() -> tuple[AnalysedSession | None, AnalysedSession | None, Patient]:
        with db.read() as c:
            patient = patients.get(c, sessions.get(c, sid).patient_id)
            this = _replayable(c, sid)
            if this is None or other is None:
                return this, None, patient
            comparisons.pair(c, sid, other)  # refuses a visit of somebody else
            return this, _replayable(c, other), patient

    def why_nothing() -> str:
        with db.read() as c:
            found = analyses.latest(c, sid)
            edits = None if found is None else edit_log.edits_of(c, found.id)
        if found is None or edits is None:
            return "There is nothing to replay: nothing is analysed yet."
        return explain_no_figure(reviewed.read_bundle(found, edits))

    this, before, patient = await asyncio.to_thread(latest)
    for seen in (this, before):
        if seen is not None:
            await asyncio.to_thread(
                state.trail.record_watched, who, "replay.opened", "session", seen.session.id
            )
    if this is None:
        raise Problem(404, "no_poses", await asyncio.to_thread(why_nothing))

    def load() -> ReplayMotion:
        motion = _motion(reviewed.blobs, this)
        ghosts = find_references(reviewed, this, patient, motion)
        if before is not None:
            mine, theirs = (reviewed.read_bundle(a.found, a.edits).strides for a in (this, before))
            visit = match_ghost(motion, mine, _motion(reviewed.blobs, before), theirs)
            ghosts["visit"] = lambda: visit
        return replace(motion, ghosts=ghosts)

    shown = _state(this) if before is None else f"{_state(this)} over {_state(before)}"
    return await _views(ws).open(who.login_id, tab, sid, shown, load, **shown_first)


def _replayable(c: Connection, sid: str) -> AnalysedSession | None:
    found = analyses.latest(c, sid)
    if found is None or "poses.parquet" not in found.files:
        return None
    return AnalysedSession(sessions.get(c, sid), found, edit_log.edits_of(c, found.id))


def _state(a: AnalysedSession) -> str:
    """A ghost follows the strides, so it follows their edits."""
    return f"{a.found.id} {a.edits.key}"


def _motion(blobs: BlobStore, a: AnalysedSession) -> ReplayMotion:
    return prepare_motion(read_poses(analyses.file_bytes(blobs, a.found, "poses.parquet")))


async def _follow(
    ws: WebSocket, view: FigureView[ReplayFigure], activity: ViewActivity, answer: Mapping[str, Any]
) -> None:
    """Say which view it is, pose the figure at every {"t"} and answer with what is shown."""
    try:
        await ws.send_json(answer)
    except WebSocketDisconnect:  # the page was left while the view was being opened
        return
    while True:
        try:
            message = await ws.receive_text()
        except WebSocketDisconnect:
            return
        # a ghost may have to be computed first
        await ws.send_json(
            await asyncio.to_thread(_act, view, message) if '"ghost"' in message else _act(view, message)
        )
        await activity.note_activity()


def _act(view: FigureView[ReplayFigure], text: str) -> dict[str, Any]:
    try:
        message = read_json(text)
    except ValueError:
        message = None
    motion = view.figure.motion
    if isinstance(message, dict) and len(message) == 1:
        ((name, value),) = message.items()
        if name == "t" and type(value) in (int, float) and math.isfinite(value):
            shown = view.figure.pose(float(value))
            return {"t": shown, "valid": view.figure.is_valid(shown)}
        if name == "look" and isinstance(value, str) and value in VIEWS:
            view.figure.look_from(cast("ViewName", value))
            return {"look": value}
        if name == "ghost" and (value is None or (isinstance(value, str) and value in motion.ghosts)):
            try:
                return {"ghost": value if view.figure.set_ghost(cast("GhostName | None", value)) else None}
            except SagittalError as error:
                return {"ghost": None, "why": str(error)}
        switch = _SWITCHES.get(name)
        if switch and isinstance(value, bool):
            switch(view.figure, value)
            return {name: value}
    detail = (
        f'Expected {{"t": seconds}}, true or false for one of {", ".join(_SWITCHES)}, "look": one of '
        f'{", ".join(VIEWS)}, or "ghost": null or one of {", ".join(motion.ghosts)}.'
    )
    return {"error": {"code": "bad_message", "detail": detail}}


def _views(connection: Request | WebSocket) -> FigureViews:
    views: FigureViews = connection.app.state.views
    return views
