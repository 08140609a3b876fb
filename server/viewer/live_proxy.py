"""Route of the live 3D avatar of a session.

    GET /sessions/{sid}/live/figure?dark=…   opens it: {"src": "/views/<id>/"} for an iframe (proxy.py)

The view is shared by all users permitted to run live sessions, one per theme, and is recreated after it was
stopped: a page only needs to request it again after losing its connection.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Annotated, cast

import numpy as np
import viser
from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse

from sagittal.core.body.kinematics import nominal_body
from sagittal.core.body.model import BodyModel
from sagittal.core.frames import Floats, Side
from sagittal.core.norms import look_up_norms
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.context import Db, Id, OpenTrail, state_of
from sagittal.server.live.hub import Hub
from sagittal.server.live_takes import live
from sagittal.server.storage.db import Database
from sagittal.server.viewer.live.live_figure import LiveFigure
from sagittal.server.viewer.live.live_reference import LiveReference, NormAt
from sagittal.server.viewer.live_watch import LiveWatch
from sagittal.server.viewer.views import FigureView, FigureViews

router = APIRouter(include_in_schema=False)


@router.get("/sessions/{sid}/live/figure")
async def figure(
    request: Request,
    db: Db,
    trail: OpenTrail,
    sid: Id,
    user: Annotated[Identity, require(Action.RUN_LIVE)],
    dark: bool = False,
) -> JSONResponse:
    """Open the live avatar of a session."""
    hub = state_of(request).hub
    body, norm = await asyncio.to_thread(_person, db, sid, hub.owner)
    await asyncio.to_thread(trail.record_watched, user, "live.watched", "session", sid)
    views: FigureViews = request.app.state.views

    def draw(server: viser.ViserServer) -> LiveFigure:
        return LiveFigure(server, body, dark)

    def attend(view: FigureView[LiveFigure]) -> None:
        _attend(view, hub, sid, LiveReference(body, norm, lambda: _trained(hub, sid)))

    view = await views.open_live(sid, "dark" if dark else "light", draw, attend)
    return JSONResponse({"src": f"/views/{view.id}/"}, headers={"Cache-Control": "no-store"})


def _person(db: Database, sid: str, owner: live.TakeOwner) -> tuple[BodyModel, NormAt]:
    """Body model of the patient, and norm curves as a function of speed; raises NotFound, NodeAway."""
    with db.read() as c:
        session = sessions.get(c, sid)
        take = live.current(c, sid)
        if take is not None and take.is_open:
            owner.require(take)
        patient = patients.get(c, session.patient_id)
    height = patient.find_height(session)
    age = patient.find_age(session.performed_on)

    def norm_at(speed_mps: float | None) -> Mapping[str, Floats]:
        bands = look_up_norms(age, None, speed_mps, height).bands
        return {name: np.radians(band.mean_deg) for name, band in bands.items()}

    return nominal_body(height)[0], norm_at


def _attend(view: FigureView[LiveFigure], hub: Hub, sid: str, reference: LiveReference) -> None:
    """Subscribe a new view to the session's pictures until it ends."""
    room = hub.room(sid)

    def ghost() -> object:
        take = hub.take_of(sid)
        return None if take is None else take.steered.ghost

    watch = LiveWatch(
        view.figure, reference, ghost=ghost, strides=lambda: room.strides, watched=lambda: view.viewers > 0
    )
    until = ExitStack()
    until.callback(hub.leave, sid)
    until.enter_context(room.watching(watch.see))
    clock = asyncio.create_task(watch.run())
    until.callback(clock.cancel)
    view.let_go = until.close


def _trained(hub: Hub, sid: str) -> Side | None:
    """Side of the prescription in force."""
    take = hub.take_of(sid)
    side = None if take is None or take.training.prescription is None else take.training.prescription["side"]
    return cast("Side", side) if side in ("left", "right") else None
