"""Every part of the API hangs below its prefix, with a door."""

from __future__ import annotations

import pytest
from fastapi import APIRouter, FastAPI
from starlette.routing import Match

from sagittal.server.api.routes import BESIDE, build_api
from sagittal.server.auth.roles import Action
from sagittal.server.auth.routes import list_declared_actions
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="module")
def api() -> APIRouter:
    return build_api()


def test_every_route_is_below_the_prefix_and_says_who_may(api: APIRouter) -> None:
    declared = list_declared_actions(api.routes)
    assert len(declared) > 100
    assert not [route for route in declared if not route.split(" ")[1].startswith("/api/v1/")]
    assert declared["GET /api/v1/openapi.json"] == Action.READ_API
    # one of each of the parts that are easily forgotten
    assert {
        "PUT /api/v1/sessions/{session_id}/references/{name:path}", "WEBSOCKET /api/v1/live",
        "GET /api/v1/jobs",
    } <= set(declared)  # fmt: skip


def test_what_stands_beside_the_api_is_no_part_of_it() -> None:
    neighbour = {route for router in BESIDE for route in list_declared_actions(router.routes)}
    assert {"GET /health/live", "GET /sign-in/{token}", "WEBSOCKET /sessions/{sid}/live/feed"} <= neighbour
    assert not [route for route in neighbour if "/api" in route]


@pytest.mark.parametrize(
    ("path", "found"),
    [("/api/v1/patients", True), ("/api/v1/nothing", False), ("/api/v1", False), ("/patients", False)],
)
def test_an_address_elsewhere_is_not_searched_for(api: APIRouter, path: str, found: bool) -> None:
    app = FastAPI(openapi_url=None)
    app.include_router(api)
    scope = {"type": "http", "path": path, "method": "GET", "headers": [], "root_path": ""}
    assert any(route.matches(scope)[0] is Match.FULL for route in app.routes) == found


async def test_who_is_not_signed_in_reads_no_description(clinic: Clinic) -> None:
    async with clinic.client() as client:
        assert (await client.get("/api/v1/openapi.json")).status_code == 401
    async with clinic.client("viewer") as client:
        assert (await client.get("/api/v1/nothing")).status_code == 404
