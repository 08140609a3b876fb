"""HTTP connections with timeouts, so that incomplete requests do not hold a connection indefinitely.

uvicorn only closes connections that are idle between two requests. Here request headers have a deadline,
bodies a minimum rate, and responses must keep being read by the client. None of this limits the duration of a
response: event streams and websockets may stay open. A body that we read slowly is not held against the
client.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Any, Final, Literal

import h11
from uvicorn.protocols.http.h11_impl import STATUS_PHRASES, H11Protocol

from sagittal.server.web_server.listener import SeldomLog

_full: Final = SeldomLog()


@dataclass(frozen=True)
class ConnectionLimits:
    """Limits of a connection.

    Parameters
    ----------
    most : simultaneous connections; further ones are answered with 503 and closed.
    head_s : time limit for the request line and headers.
    body_s, body_bytes : minimum rate of a body: bytes per interval, or the remainder.
    unread_s : time limit for reading part of a response that fills all buffers.
    """

    most: int = 1000
    head_s: float = 20.0
    body_s: float = 60.0
    body_bytes: int = 6000
    unread_s: float = 60.0


class TimedConnection(H11Protocol):
    """uvicorn's HTTP/1.1 protocol with limits; `make_connection_class` creates the class for a server."""

    limits = ConnectionLimits()

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._awaited: Literal["head", "body"] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._unread_timer: asyncio.TimerHandle | None = None
        self._came = 0
        self._held_back = False
        self._upgraded = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept a connection, or reject it if there are too many."""
        super().connection_made(transport)
        if len(self.connections) > self.limits.most:
            _full.warn(f"{self.limits.most} connections are open, the most there may be: others are refused.")
            self._refuse(503, "The server has too many connections. Try again in a minute.")
        else:
            self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the timers."""
        self._stop_timer()
        self._stop_unread_timer()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Process received data."""
        self._came += len(data)
        super().data_received(data)
        self._watch()

    def pause_writing(self) -> None:
        """Wait until the client has read part of the response, up to a timeout."""
        super().pause_writing()
        self._watch_unread()

    def resume_writing(self) -> None:
        """Resume sending the response."""
        super().resume_writing()
        self._stop_unread_timer()

    def on_response_complete(self) -> None:
        """Continue with the next request."""
        super().on_response_complete()
        self._watch()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Hand the connection over to the websocket protocol, which has its own pings."""
        self._upgraded = True
        self._stop_unread_timer()
        super().handle_websocket_upgrade(event)
        # a request that is no handshake (a POST, a body, too many headers) gets neither a response nor a
        # timeout there
        if not self.transport.get_protocol().handshake_initiated:  # type: ignore[attr-defined]
            self._refuse(400, "This is no websocket handshake: send a GET without a body and fewer headers.")

    def _watch(self) -> None:
        """Run the timer for the data currently expected from the client."""
        awaited = self._what_is_awaited()
        if awaited == self._awaited:
            return
        self._stop_timer()
        self._awaited = awaited
        if awaited == "head":
            self._timer = self.loop.call_later(self.limits.head_s, self._head_is_late)
        elif awaited == "body":
            self._begin_window()

    def _what_is_awaited(self) -> Literal["head", "body"] | None:
        if self._upgraded or self.transport.is_closing():
            return None
        state = self.conn.their_state
        if state is h11.SEND_BODY:
            return "body"
        # between two requests uvicorn's own timer runs
        is_begun = self.cycle is None or bool(self.conn.trailing_data[0])
        return "head" if state is h11.IDLE and is_begun else None

    def _begin_window(self) -> None:
        self._came = 0
        self._held_back = self._is_held_back()
        self._timer = self.loop.call_later(self.limits.body_s, self._end_window)

    def _end_window(self) -> None:
        if self._came >= self.limits.body_bytes or self._held_back or self._is_held_back():
            self._begin_window()
        else:
            self._refuse(408, f"The body came too slowly: {self._came} bytes in {self.limits.body_s:g} s.")

    def _watch_unread(self) -> None:
        self._stop_unread_timer()
        self._unread_timer = self.loop.call_later(
            self.limits.unread_s, self._end_unread, self.transport.get_write_buffer_size()
        )

    def _end_unread(self, unread: int) -> None:
        # a long response may take many windows on a slow connection
        if self.transport.get_write_buffer_size() < unread:
            self._watch_unread()
        else:
            self.transport.abort()

    def _stop_unread_timer(self) -> None:
        if self._unread_timer is not None:
            self._unread_timer.cancel()
            self._unread_timer = None

    def _is_held_back(self) -> bool:
        """Whether the client is waiting for us rather than we for it."""
        return self.flow.read_paused or self.cycle.waiting_for_100_continue

    def _head_is_late(self) -> None:
        if self.conn.trailing_data[0]:
            self._refuse(408, f"The head of the request did not come within {self.limits.head_s:g} s.")
        else:
            self.transport.close()  # browsers open connections in advance, and a response would confuse them

    def _refuse(self, status: int, detail: str) -> None:
        """Send an error response if still possible, and close."""
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            headers = [
                (b"content-type", b"text/plain; charset=utf-8"),
                (b"content-length", str(len(detail)).encode()),
                (b"connection", b"close"),
            ]
            for event in (
                h11.Response(status_code=status, headers=headers, reason=STATUS_PHRASES[status]),
                h11.Data(data=detail.encode("ascii")),
                h11.EndOfMessage(),
            ):
                self.transport.write(self.conn.send(event) or b"")
        if self.cycle is not None:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        if self.transport.get_write_buffer_size():
            self.transport.abort()  # a client that does not read would keep the rest here
        else:
            self.transport.close()

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def make_connection_class(limits: ConnectionLimits) -> type[TimedConnection]:
    """Connection class with these limits."""
    return type("LimitedConnection", (TimedConnection,), {"limits": limits})
