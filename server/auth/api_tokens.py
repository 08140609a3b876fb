"""API tokens: programs act for a user with a subset of that user's permissions until the token expires.

    Authorization: Bearer sgt_…

The token is shown once; the database stores its hash. It is accepted only in this header and only on /api/v1
and /metrics, never in a URL, a cookie or a websocket. It becomes invalid when it expires, is revoked or its
account is closed; restricting the user's role restricts the token too.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection, Mapping, Sequence
from enum import StrEnum
from typing import Any, Final

from sqlalchemy import Connection, Row, delete, insert, select, update
from sqlalchemy.exc import OperationalError
from starlette.requests import HTTPConnection

from sagittal.core.message import Message
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action, Role
from sagittal.server.auth.sight import NOTHING, opens_parts
from sagittal.server.auth.tokens import new_token, token_hash
from sagittal.server.http.problems import Problem
from sagittal.server.storage.db import Database
from sagittal.server.storage.refusal import refusal_of
from sagittal.server.storage.schema.person_tables import api_token
from sagittal.server.storage.schema.tables import new_id, now, user

PREFIX: Final = "sgt_"
"""Makes leaked tokens recognizable."""
MOST_DAYS: Final = 365
MOST_TOKENS: Final = 50
"""Per user."""
_TOUCH_EVERY: Final = dt.timedelta(minutes=10)
_DOORS: Final = ("/api/v1/", "/metrics")


class Scope(StrEnum):
    """Permission that a token may be issued for."""

    READ = "read"
    UPLOAD = "upload"
    WRITE = "write"
    METRICS = "metrics"


_READ = frozenset(
    {
        Action.READ_API,
        Action.READ_PATIENT,
        Action.READ_SESSION,
        Action.READ_RESULT,
        Action.READ_JOB,
        Action.READ_DEVICE,
    }
)
SCOPES: Final[Mapping[Scope, frozenset[Action]]] = {
    Scope.READ: _READ,
    Scope.UPLOAD: frozenset({Action.CREATE_SESSION, Action.UPLOAD}),
    Scope.WRITE: frozenset(
        {
            Action.WRITE_PATIENT,
            Action.CREATE_SESSION,
            Action.WRITE_SESSION,
            Action.UPLOAD,
            Action.ANALYSE,
            Action.REVIEW,
            Action.CANCEL_JOB,
        }
    ),
    Scope.METRICS: frozenset({Action.READ_SYSTEM}),
}
"""Actions allowed by each scope; none deletes a patient or visit, reads the audit log or changes accounts."""


def issue(
    c: Connection, user_id: str, name: str, scopes: Collection[Scope], days: int
) -> tuple[Row[Any], str]:
    """Issue a token; return its row and the token, which is not stored. Raises Problem 409 for more
    than 50.
    """
    if len(list_tokens(c, user_id)) >= MOST_TOKENS:
        raise Problem(
            409,
            "too_many_tokens",
            Message(
                "An account can have at most {MOST_TOKENS} tokens. Revoke one you no longer use.",
                MOST_TOKENS=MOST_TOKENS,
            ),
        )
    token, issued_at = PREFIX + new_token(), now()
    values = {
        "id": new_id(),
        "user_id": user_id,
        "name": name,
        "token_sha256": token_hash(token),
        "scopes": sorted(scopes),
        "created_at": issued_at,
        "expires_at": issued_at + dt.timedelta(days=days),
    }
    c.execute(insert(api_token).values(values))
    return c.execute(select(api_token).where(api_token.c.id == values["id"])).one(), token


def list_tokens(c: Connection, user_id: str) -> Sequence[Row[Any]]:
    """Tokens of a user including expired ones, newest first."""
    mine = select(api_token).where(api_token.c.user_id == user_id)
    return c.execute(mine.order_by(api_token.c.created_at.desc(), api_token.c.id)).all()


def revoke(c: Connection, user_id: str, token_id: str) -> None:
    """Revoke one token of a user; raises Problem 404."""
    gone = c.execute(delete(api_token).where(api_token.c.id == token_id, api_token.c.user_id == user_id))
    if not gone.rowcount:
        raise Problem(404, "token_not_found", "No such token; it may already have been revoked.")


def revoke_all(c: Connection, user_id: str) -> None:
    """Revoke all tokens of a user."""
    c.execute(delete(api_token).where(api_token.c.user_id == user_id))


def read_bearer(connection: HTTPConnection) -> str | None:
    """Bearer token of this request, None if absent or not accepted on this route."""
    scheme, _, token = connection.headers.get("authorization", "").partition(" ")
    if scheme.lower() != "bearer" or connection.scope["type"] != "http":
        return None
    return token.strip() if connection.url.path.startswith(_DOORS) else None


def find_bearer(db: Database, token: str, parts: Mapping[str, str] = NOTHING) -> Identity | None:
    """Identity for a token; None if it is unknown, expired or revoked, or its account is closed."""
    time = now()
    query = (
        select(
            user,
            api_token.c.scopes,
            api_token.c.used_at,
            api_token.c.id.label("token_id"),
            opens_parts(parts).label("opens"),
        )
        .join(api_token, api_token.c.user_id == user.c.id)
        .where(api_token.c.token_sha256 == token_hash(token), api_token.c.expires_at > time, user.c.active)
    )
    rows = db.ask(query)
    if not rows:
        return None
    [row] = rows
    if row.used_at is None or row.used_at <= time - _TOUCH_EVERY:
        _write_used(db, row.token_id, time)
    allowed = frozenset[Action]().union(*(SCOPES[Scope(scope)] for scope in row.scopes))
    login_id = f"token:{row.token_id}"
    return Identity(
        row.id, row.name, row.display_name, Role(row.role), login_id, row.language, allowed, bool(row.opens)
    )


def _write_used(db: Database, token_id: str, time: dt.datetime) -> None:
    try:
        with db.write() as c:
            c.execute(update(api_token).where(api_token.c.id == token_id).values(used_at=time))
    except OperationalError as error:
        if refusal_of(error) is None:
            raise
