"""Compresses pages, JSON, style sheets and scripts to about a fifth of their size.

Event streams (an event must not wait for the next), downloads and ranges (the client expects the exact bytes)
and content that is already compressed are sent unchanged.

Compression makes a BREACH attack possible: an eavesdropper who causes a browser to repeat requests with
guesses in the URL can infer the page's content from the length of the encrypted response. Such requests
originate from the attacker's page; browsers mark them as cross-site, and their responses are not compressed.
No page contains an anti-forgery token (cross_site.py relies on the same headers) or the session cookie.
"""

from __future__ import annotations

import asyncio
import zlib
from typing import Any, Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from sagittal.server.http.cross_site import is_cross_site

LEVEL: Final = 5
"""A session page of 144 kB: 29 kB in 2.4 ms; level 9 takes twice as long for 28, level 1 half for 36."""
LEAST_BYTES: Final = 1000
"""Content that fits into one packet is not compressed."""
LONG_BYTES: Final = 32_000
"""Larger content is compressed in a thread, so that it does not block other requests."""

_TYPES: Final = frozenset({"application/json", "application/javascript", "image/svg+xml"})
_GZIP_FORMAT: Final = 16 + zlib.MAX_WBITS


class Compression:
    """ASGI middleware that compresses suitable responses for clients that accept gzip."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or scope["method"] == "HEAD":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        takes_gzip = accepts("gzip", headers.get("accept-encoding", "")) and not is_cross_site(headers)
        await self.app(scope, receive, _Answer(send, takes_gzip).pass_on)


def accepts(encoding: str, accept_encoding: str) -> bool:
    """Whether an Accept-Encoding header (RFC 9110 §12.5.3) allows an encoding, such as gzip or br."""
    allowed = {}
    for part in accept_encoding.lower().replace(" ", "").split(","):
        name, _, weight = part.partition(";q=")
        allowed[name] = weight.strip("0.") != "" or not weight
    return allowed.get(encoding, allowed.get("*", False))


def is_compressible(status: int, headers: Headers) -> bool:
    """Whether a response is complete text meant for display rather than download."""
    kind = headers.get("content-type", "").partition(";")[0].strip().lower()
    return (
        status not in (204, 206, 304)
        and "content-encoding" not in headers
        and "content-range" not in headers
        and not headers.get("content-disposition", "").startswith("attachment")
        and (kind in _TYPES or kind.endswith("+json") or kind.startswith("text/"))
        and kind != "text/event-stream"
    )


class _Answer:
    """A response in progress; its headers wait for the first part of the body, which decides on
    compression.
    """

    def __init__(self, send: Send, takes_gzip: bool) -> None:
        self._send = send
        self._takes_gzip = takes_gzip
        self._head: Message | None = None
        self._packer: Any = None

    async def pass_on(self, message: Message) -> None:
        """Forward one message of the application."""
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            is_candidate = is_compressible(message["status"], headers)
            if is_candidate or message["status"] == 304:
                headers.add_vary_header("Accept-Encoding")
            if is_candidate and self._takes_gzip:
                self._head = message
                return
        elif message["type"] == "http.response.body":
            body, is_last = message.get("body", b""), not message.get("more_body", False)
            head, self._head = self._head, None
            if head is not None and (len(body) >= LEAST_BYTES or not is_last):
                self._packer = zlib.compressobj(LEVEL, zlib.DEFLATED, _GZIP_FORMAT)
            if self._packer is not None:
                body = await self._packed(body, is_last)
                message = {**message, "body": body}
                if head is not None:
                    _declare(MutableHeaders(scope=head), len(body) if is_last else None)
            if head is not None:
                await self._send(head)
        await self._send(message)

    async def _packed(self, body: bytes, is_last: bool) -> bytes:
        def pack() -> bytes:
            # parts sent early must be visible early
            mode = zlib.Z_FINISH if is_last else zlib.Z_SYNC_FLUSH
            return bytes(self._packer.compress(body) + self._packer.flush(mode))

        return await asyncio.to_thread(pack) if len(body) >= LONG_BYTES else pack()


def _declare(headers: MutableHeaders, size: int | None) -> None:
    """Set the headers of a compressed response; `size` None = not known in advance."""
    headers["Content-Encoding"] = "gzip"
    del headers["Content-Length"]
    if size is not None:
        headers["Content-Length"] = str(size)
    del headers["Accept-Ranges"]  # ranges are not available for it
    if (tag := headers.get("etag", "")).startswith('"'):
        headers["ETag"] = f"W/{tag}"  # same content, different bytes (RFC 9110 §8.8.1)
