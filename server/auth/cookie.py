"""Session cookie: `__Host-sid` over TLS, plain `sid` for HTTP on loopback (`Secure` is unavailable there)."""

from __future__ import annotations

from starlette.requests import HTTPConnection
from starlette.responses import Response

SECURE_NAME = "__Host-sid"
LOOPBACK_NAME = "sid"


def read_token(connection: HTTPConnection) -> str | None:
    """Return the session token, read only from the cookie name that this installation sets."""
    return connection.cookies.get(_name(connection)) or None


def set_token(response: Response, connection: HTTPConnection, token: str) -> None:
    """Set the token as a browser-session cookie; its lifetime is controlled by the server."""
    response.set_cookie(
        _name(connection), token, path="/", secure=_is_secure(connection), httponly=True, samesite="lax"
    )


def clear_token(response: Response, connection: HTTPConnection) -> None:
    """Delete the session cookie in the browser."""
    response.delete_cookie(
        _name(connection), path="/", secure=_is_secure(connection), httponly=True, samesite="lax"
    )


def _is_secure(connection: HTTPConnection) -> bool:
    return bool(connection.app.state.settings.secure_cookies)


def _name(connection: HTTPConnection) -> str:
    return SECURE_NAME if _is_secure(connection) else LOOPBACK_NAME
