"""All routes of the API, including those outside /api/v1 that serve no page."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Request
from starlette.routing import Match
from starlette.types import Scope

from sagittal.server.api import audit_log, health, metrics
from sagittal.server.api.account import api_tokens, second_factor, security_keys, sign_in, users
from sagittal.server.api.clinic import (
    consents,
    devices,
    identities,
    jobs,
    notes,
    patients,
    programmes,
    sessions,
)
from sagittal.server.api.documents import openapi
from sagittal.server.api.downloads import archives, exports, studies
from sagittal.server.api.live_takes import films, live, live_feed
from sagittal.server.api.results import (
    analyses,
    comparisons,
    estimators,
    filter_runs,
    prescriptions,
    reports,
    reviews,
    sensitivities,
    trends,
    tunings,
)
from sagittal.server.api.sharing import care_teams, signed_reports
from sagittal.server.api.uploads import files, tables, uploads, videos
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.live import tablet

BESIDE: tuple[APIRouter, ...] = (sign_in.address_router, health.router, metrics.router, live_feed.router)
"""Routes outside /api/v1."""


class ApiRouter(APIRouter):
    """Router that skips all its routes for paths outside its prefix."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        """Match a request to a route."""
        return super().matches(scope) if f"{self.prefix}/" in scope["path"] else (Match.NONE, {})


def build_api() -> APIRouter:
    """Return everything under /api/v1, including the OpenAPI document."""
    api = ApiRouter(prefix="/api/v1")
    for part in (
        sign_in,
        api_tokens,
        second_factor,
        security_keys,
        patients,
        notes,
        consents,
        identities,
        care_teams,
        prescriptions,
        programmes,
        sessions,
        files,
        uploads,
        tables,
        videos,
        analyses,
        sensitivities,
        exports,
        studies,
        tunings,
        estimators,
        films,
        filter_runs,
        reports,
        signed_reports,
        archives,
        reviews,
        trends,
        comparisons,
        live,
        jobs,
        devices,
        users,
        audit_log,
        tablet,
    ):
        api.include_router(part.router)
    api.include_router(filter_runs.references)

    @api.get("/openapi.json", include_in_schema=False)
    def document(request: Request, user: Annotated[Identity, require(Action.READ_API)]) -> dict[str, Any]:
        """Describe this API as OpenAPI."""
        return openapi(request.app)

    return api
