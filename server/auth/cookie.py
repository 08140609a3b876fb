"""The session cookie: `__Host-sid` behind TLS, plain `sid` on loopback http (no Secure there)."""

from __future__ import annotations

from starlette.requests import HTTPConnection
from starlette.responses import Response

SECURE_NAME = "__Host-sid"
LOOPBACK_NAME = "sid"


def read_token(connection: HTTPConnection) -> str | None:
    """Return the session token, only from the cookie name that this installation gives out."""
    return connection.cookies.get(_name(connection)) or None


def set_token(response: Response, connection: HTTPConnection, token: str) -> None:
    """Give the browser its token for as long as the browser runs; the server decides when it ends."""
    response.set_cookie(
        _name(connection), token, path="/", secure=_is_secure(connection), httponly=True, samesite="lax"
    )


def clear_token(response: Response, connection: HTTPConnection) -> None:
    """Take the token back from the browser."""
    response.delete_cookie(
        _name(connection), path="/", secure=_is_secure(connection), httponly=True, samesite="lax"
    )


def _is_secure(connection: HTTPConnection) -> bool:
    return bool(connection.app.state.settings.secure_cookies)


def _name(connection: HTTPConnection) -> str:
    return SECURE_NAME if _is_secure(connection) else LOOPBACK_NAME
