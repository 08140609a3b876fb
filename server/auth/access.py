"""Access control for routes: a dependency that declares the action of a route and enforces its permission."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from fastapi import Depends
from sqlalchemy.exc import SQLAlchemyError
from starlette.requests import HTTPConnection

from sagittal.server.auth.api_tokens import find_bearer, read_bearer
from sagittal.server.auth.cookie import read_token
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import PUBLIC, Action
from sagittal.server.auth.sessions import CHECK_EVERY_S, Logins
from sagittal.server.auth.sight import list_hidden, may_open
from sagittal.server.http.problems import SENTENCES, Problem
from sagittal.server.storage.db import Database
from sagittal.server.trail import AuditTrail


class RouteAccess:
    """Dependency of one route; `action` is read by the check over all routes."""

    def __init__(self, action: Action) -> None:
        self.action = action

    def __call__(self, connection: HTTPConnection) -> Identity | None:
        """Return the identity of the caller; raise Problem 401 if not signed in, 403 if not permitted.

        Raises 404 if the clinic has care teams and the path refers to a patient outside the caller's teams.
        """
        counts = self.action is not Action.WATCH_SIGN_IN
        identity = identify(connection, connection.path_params, counts=counts)
        connection.state.language = None if identity is None else identity.language
        if self.action in PUBLIC:
            return identity
        if identity is None:
            raise Problem(401, "not_signed_in", SENTENCES["not_signed_in"])
        if not identity.may(self.action):
            raise Problem(403, "forbidden", SENTENCES["forbidden"])
        if not identity.opens:
            _note_try(connection, identity)
            raise Problem(404, "not_found", SENTENCES["not_found"])
        return identity


def _note_try(connection: HTTPConnection, user: Identity) -> None:
    """Record an attempt to open a patient outside the care team; the response is as for an unknown id."""
    db: Database = connection.app.state.db
    trail: AuditTrail = connection.app.state.trail
    with db.read() as c:
        hidden = list_hidden(c, user.user_id, connection.path_params)
    for patient_id in hidden:
        trail.record_tried(user, "patient.hidden", "patient", patient_id)


def require(action: Action) -> Any:
    """Declare a route's action: `user: Annotated[Identity, require(Action.UPLOAD)]`, for HTTP or
    websocket.
    """
    return Depends(RouteAccess(action))


def identify(connection: HTTPConnection, parts: Mapping[str, str], *, counts: bool = True) -> Identity | None:
    """Return the identity on this connection with its access to the path parameters; None if anonymous.

    Parameters
    ----------
    counts : whether the request counts as activity and prolongs the sign-in.
    """
    bearer = read_bearer(connection)
    if bearer is not None:
        return find_bearer(connection.app.state.db, bearer, parts)
    token = read_token(connection)
    if token is None:
        return None
    logins: Logins = connection.app.state.logins
    return logins.find(token, parts) if counts else logins.look(token, parts)


def opens(connection: HTTPConnection, user: Identity, parts: Mapping[str, str]) -> bool:
    """Whether the user may open the resources given by path parameters (server/auth/sight.py)."""
    db: Database = connection.app.state.db
    with db.read() as c:
        return may_open(c, user, parts)


def find_end(connection: HTTPConnection, **parts: str) -> str | None:
    """Reason why a long-lived connection must close: `not_signed_in`, or `not_found` if access was withdrawn.

    Returns None while the sign-in is valid and still grants access; the check does not count as activity.
    `parts` default to the path parameters of the connection.
    """
    user = identify(connection, parts or connection.path_params, counts=False)
    if user is None:
        return "not_signed_in"
    return None if user.opens else "not_found"


async def wait_for_end(find: Callable[[], str | None]) -> str:
    """Wait until a long-lived connection must close and return the reason.

    Parameters
    ----------
    find : such as `find_end`, called in a thread every `CHECK_EVERY_S`. Database errors are ignored and the
        check is repeated.
    """
    while True:
        await asyncio.sleep(CHECK_EVERY_S)
        try:
            reason = await asyncio.to_thread(find)
        except SQLAlchemyError:
            continue
        if reason is not None:
            return reason
