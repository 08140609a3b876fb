"""Assembles the web application; contains no other logic."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cache
from typing import TYPE_CHECKING

from sagittal.server.settings import Settings

if TYPE_CHECKING:
    from fastapi import FastAPI
    from starlette.routing import BaseRoute


def create_app(settings: Settings) -> FastAPI:
    """Return the application of one installation; its lifespan opens and closes its resources.

    Raises
    ------
    UndeclaredRouteError
        a route declares no action.
    UnknownViserError
        the installed viser is incompatible with the 3D views.
    """
    # the web stack and its routes take seconds to import, so they are imported only here
    from fastapi import FastAPI
    from starlette.middleware import Middleware

    from sagittal.server.context import State
    from sagittal.server.http import problems
    from sagittal.server.http.body_limit import BodyLimit
    from sagittal.server.http.compression import Compression
    from sagittal.server.http.cross_site import CrossSiteGuard
    from sagittal.server.http.headers import SecurityHeaders
    from sagittal.server.http.hosts import HostGuard
    from sagittal.server.http.requests import RequestObserver
    from sagittal.server.metrics import RequestMetrics
    from sagittal.server.nodes.forwarding import Forwarding
    from sagittal.server.nodes.known import KnownNodes
    from sagittal.server.provenance import CODE_VERSION
    from sagittal.server.viewer.viser_adapter import require_known_viser

    require_known_viser()

    metrics = RequestMetrics()
    app = FastAPI(
        title="Sagittal",
        summary="Gait analysis from body-worn IMUs; research software, not a medical device.",
        version=CODE_VERSION,
        # the interactive pages load external scripts; the document itself is served by the API
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        lifespan=_run,
        routes=list(wire_routes()),
        middleware=[
            Middleware(RequestObserver, line=settings.log_format == "json", observe=metrics.observe),
            Middleware(Compression),
            Middleware(SecurityHeaders, behind_tls=settings.behind_tls),
            *([Middleware(KnownNodes)] if settings.node_name else []),
            Middleware(HostGuard, allowed=settings.hosts),
            Middleware(CrossSiteGuard),
            Middleware(BodyLimit),
            *([Middleware(Forwarding)] if settings.node_name else []),
        ],
    )
    app.state = State({"settings": settings, "metrics": metrics})
    problems.install(app)
    return app


@asynccontextmanager
async def _run(app: FastAPI) -> AsyncIterator[None]:
    """Open the resources of the application for the duration of the context."""
    from sagittal.server.lifespan import run_installation
    from sagittal.server.viewer.proxy import open_views

    async with run_installation(app), open_views(app):
        yield


@cache
def wire_routes() -> tuple[BaseRoute, ...]:
    """Return the checked routes shared by all applications; they hold no state of an installation.

    Lifespans of FastAPI routers would be ignored here; resources are opened by `_run`.

    Raises
    ------
    UndeclaredRouteError
        a route declares no action.
    """
    from fastapi import APIRouter

    from sagittal.server.api.routes import BESIDE, build_api
    from sagittal.server.auth.routes import list_declared_actions
    from sagittal.server.pages.assets import STATIC, Assets
    from sagittal.server.pages.routes import ROUTERS
    from sagittal.server.viewer import live_proxy, proxy

    whole = APIRouter()
    for router in (build_api(), *BESIDE, *ROUTERS, proxy.router, live_proxy.router):
        whole.include_router(router)
    whole.mount("/static", Assets(directory=STATIC), name="static")
    list_declared_actions(whole.routes)
    return tuple(whole.routes)
