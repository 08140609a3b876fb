"""Security headers of every response; the viewer document has its own content security policy."""

from __future__ import annotations

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

CONTENT_POLICY = (
    "default-src 'self'; frame-src 'self'; img-src 'self' data:; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)
KEPT = "public, max-age=31536000, immutable"
"""Cache-Control of a response whose URL contains its hash."""


HTTPS_ONLY = "max-age=31536000"
"""One year, for this host only: neighbouring hosts are not ours to decide."""


def allow_camera(origins: str) -> str:
    """Return the Permissions-Policy value for camera access: "()" none, "(self)" this origin."""
    return f"camera={origins}, microphone=(), geolocation=()"


def lock_document(style_sha256: str) -> str:
    """Return the policy of a self-contained document that allows one inline style, given by its base64
    hash.
    """
    return (
        f"default-src 'none'; style-src 'sha256-{style_sha256}'; img-src data:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


_FIXED = {
    "Content-Security-Policy": CONTENT_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Frame-Options": "SAMEORIGIN",
    "Permissions-Policy": allow_camera("()"),
    # clinical pages must not remain on a shared tablet after sign-out
    "Cache-Control": "no-store",
}


def add_security_headers(headers: MutableHeaders) -> None:
    """Add each header that the route has not set itself."""
    for name, value in _FIXED.items():
        headers.setdefault(name, value)


class SecurityHeaders:
    """ASGI middleware that adds each header unless the route has set its own.

    Parameters
    ----------
    behind_tls : also send Strict-Transport-Security, so that browsers use HTTPS only.
    """

    def __init__(self, app: ASGIApp, *, behind_tls: bool = False) -> None:
        self.app, self._behind_tls = app, behind_tls

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection with the headers added."""

        async def with_headers(message: Message) -> None:
            if message["type"] in {"http.response.start", "websocket.http.response.start"}:
                headers = MutableHeaders(scope=message)
                add_security_headers(headers)
                if self._behind_tls:
                    headers["Strict-Transport-Security"] = HTTPS_ONLY
            await send(message)

        await self.app(scope, receive, with_headers)
