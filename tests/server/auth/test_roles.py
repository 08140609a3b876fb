from __future__ import annotations

import re
from typing import Any

import pytest
from fastapi import APIRouter, Depends, FastAPI, WebSocket
from starlette.applications import Starlette
from starlette.routing import Mount

from sagittal.server.auth.access import require
from sagittal.server.auth.roles import POLICY, PUBLIC, Action, Role, is_permitted
from sagittal.server.auth.routes import UndeclaredRouteError, list_declared_actions
from tests.helpers.clinic import Clinic
from tests.helpers.engines import on_both_engines
from tests.server.sockets import ask_websocket

pytestmark = pytest.mark.anyio

ANYBODY = [*Role, None]


def test_every_action_is_public_or_has_a_row_and_none_is_both() -> None:
    assert set(POLICY) | PUBLIC == set(Action)
    assert not set(POLICY) & PUBLIC


def test_an_action_without_a_row_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(POLICY, Action.READ_AUDIT)
    assert not any(is_permitted(role, Action.READ_AUDIT) for role in Role)


def test_an_assistant_uploads_and_sees_no_result() -> None:
    assert is_permitted(Role.ASSISTANT, Action.UPLOAD)
    for action in (Action.READ_RESULT, Action.ANALYSE, Action.WRITE_PATIENT, Action.DELETE_PATIENT):
        assert not is_permitted(Role.ASSISTANT, action)


def _with_route() -> FastAPI:
    app = FastAPI(openapi_url=None)
    router = APIRouter()

    @router.get("/inner")
    def inner() -> None:
        """Open to everybody, by mistake."""

    app.include_router(router, prefix="/outer")
    return app


def _with_websocket() -> FastAPI:
    app = FastAPI(openapi_url=None)

    @app.websocket("/ws")
    async def ws(websocket: WebSocket) -> None:
        """Open to everybody, by mistake."""

    return app


def _with_mount() -> FastAPI:
    return FastAPI(openapi_url=None, routes=[Mount("/static", Starlette())])


def _with_two() -> FastAPI:
    app = FastAPI(openapi_url=None)

    @app.get("/two", dependencies=[require(Action.UPLOAD), Depends(lambda: None), require(Action.SIGN_IN)])
    def two() -> None:
        """Say two things at once."""

    return app


def _with_documents() -> FastAPI:
    return FastAPI()


@pytest.mark.parametrize("planted", [_with_route, _with_websocket, _with_mount, _with_two, _with_documents])
def test_a_route_without_exactly_one_action_is_found(planted: Any) -> None:
    with pytest.raises(UndeclaredRouteError):
        list_declared_actions(planted().routes)


@on_both_engines
@pytest.mark.slow
async def test_every_route_refuses_whom_the_policy_refuses_and_nobody_else(
    clinic: Clinic, engine: str
) -> None:
    """Roles × all routes of the real application: pages, API, websockets; ids that do not exist."""
    wrong = []
    people = (
        ANYBODY if engine == "sqlite" else [Role.CLINICIAN]
    )  # every route once: what it asks the database
    actions = list_declared_actions(clinic.app.routes)
    assert len(actions) > 10
    for name, action in actions.items():
        methods, _, pattern = name.partition(" ")
        path = re.sub(r"\{\w+(:path)?\}", "0" * 32, pattern)
        for role in people:
            method = methods.split(",")[0]
            if method == "MOUNT":
                continue
            expected = _expected(role, action)
            if method == "WEBSOCKET":
                cookie = {"Cookie": f"sid={clinic.token(role)}"} if role else {}
                got = await ask_websocket(clinic.app, path, cookie)
                got = got if got in {401, 403} else 200
            else:
                async with clinic.client(role) as client:
                    answer = await client.request(method, path, json={} if method != "GET" else None)
                got = {401: 401, 403: 403}.get(answer.status_code, 200)
                if action in PUBLIC and got == 401:
                    got = 200  # a sign-in that fails
            if got != expected:
                wrong.append((name, role, expected, got))
    assert wrong == []


def _expected(role: Role | None, action: Action) -> int:
    if action in PUBLIC:
        return 200
    if role is None:
        return 401
    return 200 if role in POLICY[action] else 403
