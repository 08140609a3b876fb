"""Wires the web process together; nothing is computed here."""

from __future__ import annotations

import asyncio
import contextlib
import datetime as dt
import logging
import os
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, FastAPI
from starlette.middleware import Middleware
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

import web
from server.api import (
    analyses,
    audit_log,
    comparisons,
    files,
    health,
    jobs,
    live,
    live_feed,
    patients,
    prescriptions,
    programmes,
    reports,
    reviews,
    sessions,
    sign_in,
    trends,
    users,
)
from server.api.documents import openapi
from server.auth.access import require
from server.auth.identity import Identity
from server.auth.roles import Action
from server.auth.routes import declared_actions
from server.auth.sessions import Logins
from server.auth.throttle import Throttle
from server.http import problems
from server.http.body_limit import BodyLimit
from server.http.compression import Compression
from server.http.cross_site import CrossSiteGuard
from server.http.headers import SecurityHeaders
from server.http.hosts import HostGuard
from server.jobs.feed import JobFeed
from server.jobs.table import TableQueue
from server.live import tablet
from server.live.hub import Hub
from server.pages import routes as pages
from server.services import custody, erasure
from server.services.custody import refuse_strangers
from server.services.provenance import CODE_VERSION
from server.settings import Settings
from server.storage.blobs import BlobStore
from server.storage.db import Database
from server.storage.high_water import MarkKeeper
from server.storage.migrate import upgrade
from server.storage.readiness import Readiness
from server.trail import Trail
from server.viewer import live_proxy, proxy

log = logging.getLogger(__name__)

STATIC = Path(web.__file__).parent / "static"


class Assets(StaticFiles):
    """Style sheets, scripts and icons; browsers keep them and ask whether they are still the same."""

    action = Action.LOAD_ASSET

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        """Let caches keep the file but ask each time: names carry no version."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers["Cache-Control"] = "no-cache"
        return response


def create_app(settings: Settings) -> FastAPI:
    """Return the application of one installation; its lifespan opens and closes what it needs.

    Raises
    ------
    UndeclaredRouteError
        a route declares no action.
    """
    app = FastAPI(
        title="Sagittal",
        summary="Gait analysis from body-worn IMUs; research software, not a medical device.",
        version=CODE_VERSION,
        # the interactive pages load scripts from elsewhere; the document itself is served below
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        lifespan=_lifespan,
        middleware=[
            Middleware(Compression),
            Middleware(SecurityHeaders),
            Middleware(HostGuard, allowed=settings.hosts),
            Middleware(CrossSiteGuard),
            Middleware(BodyLimit),
        ],
    )
    app.state.settings = settings
    problems.install(app)

    api = APIRouter(prefix="/api/v1")
    for part in (
        sign_in,
        patients,
        prescriptions,
        programmes,
        sessions,
        files,
        analyses,
        reports,
        reviews,
        trends,
        comparisons,
        live,
        jobs,
        users,
        audit_log,
    ):
        api.include_router(part.router)
    api.include_router(tablet.router)

    @api.get("/openapi.json", include_in_schema=False)
    def document(who: Annotated[Identity, require(Action.READ_API)]) -> dict[str, Any]:
        """Describe this API as OpenAPI."""
        return openapi(app)

    for router in (
        api,
        sign_in.address_router,
        health.router,
        *pages.ROUTERS,
        live_feed.router,
        proxy.router,
        live_proxy.router,
    ):
        app.include_router(router)
    app.mount("/static", Assets(directory=STATIC), name="static")
    declared_actions(app.routes)
    return app


def _look_after(db: Database, blobs: BlobStore, settings: Settings) -> None:
    """Finish erasures that were interrupted, and say aloud when this database is not to be trusted."""
    erasure.finish(db, blobs, settings)
    with db.read() as c:
        doubted = custody.doubt(c, settings)
    if doubted is not None:
        log.warning("%s No stored file is taken away until `sagittal accept`.", doubted)


@contextlib.asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    settings: Settings = app.state.settings
    refuse_strangers(settings)
    upgrade(settings.database)
    db = Database(settings.database)
    app.state.db = db
    app.state.blobs = BlobStore(settings.blobs)
    await asyncio.to_thread(_look_after, db, app.state.blobs, settings)
    app.state.trail = Trail(db)
    app.state.readiness = Readiness(settings, db, app.state.blobs)
    app.state.queue = TableQueue(db, settings.lease_s)
    app.state.feed = JobFeed(db)
    app.state.throttle = Throttle()
    app.state.logins = Logins(
        db, dt.timedelta(minutes=settings.idle_minutes), dt.timedelta(hours=settings.absolute_hours)
    )
    keeper = MarkKeeper(db, settings.mark)
    keeper.start()
    app.state.hub = Hub(settings, db, app.state.blobs, app.state.queue)
    await app.state.hub.start()
    try:
        async with app.state.trail.running():
            yield
    finally:
        await app.state.hub.stop()
        app.state.feed.close()
        await asyncio.to_thread(keeper.stop)
        db.close()
