"""Listening socket: sends small responses immediately; rejects new connections if out of descriptors."""

from __future__ import annotations

import errno
import logging
import os
import resource
import socket
import threading
import time
from typing import Any, Final

PER_CONNECTION: Final = 3
"""Descriptors of the most expensive connection, that of a 3D view: the browser's and both ends of viser's."""
RESERVED: Final = 256
"""Descriptors for everything other than connections: database, files, views, workers."""

_OUT_OF_RESOURCES: Final = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})

log = logging.getLogger(__name__)


class SeldomLog:
    """Rate-limited log for events that clients can trigger: at most one line a minute, with a count."""

    def __init__(self, every_s: float = 60.0) -> None:
        self._every_s = every_s
        self._next_s = -float("inf")
        self._unsaid = 0
        self._lock = threading.Lock()

    def warn(self, text: str) -> None:
        """Log a warning, or count it for the next one."""
        with self._lock:
            now = time.monotonic()
            if now < self._next_s:
                self._unsaid += 1
                return
            more, self._unsaid, self._next_s = self._unsaid, 0, now + self._every_s
        log.warning("%s%s", text, f" ({more} times more since this was last said)" if more else "")


class ListeningSocket(socket.socket):
    """Listening TCP socket for an asyncio server.

    Its protocol number is set explicitly: with 0, asyncio does not set TCP_NODELAY on accepted connections,
    and each small response waits some 40 ms for an acknowledgement.

    Without a free descriptor asyncio leaves a connection in the queue, retries 2,048 times and logs a
    traceback for each. Here one descriptor is kept in reserve and released for as long as it takes to accept
    that connection and close it.
    """

    def __init__(self, family: socket.AddressFamily) -> None:
        super().__init__(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        self._log = SeldomLog()
        self._spare: int | None = None
        self._keep_spare()

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection.

        Raises
        ------
        ConnectionAbortedError
            closed immediately for lack of descriptors; further ones may succeed.
        """
        try:
            return super().accept()
        except OSError as error:
            if error.errno not in _OUT_OF_RESOURCES:
                raise
            self._turn_away()
            raise ConnectionAbortedError(error.errno, "closed at once: no descriptor is free") from None

    def close(self) -> None:
        """Stop listening."""
        self._drop_spare()
        super().close()

    def _turn_away(self) -> None:
        self._log.warn("No file descriptor is free: new connections are closed until others have ended.")
        had_spare = self._spare is not None
        self._drop_spare()
        try:
            super().accept()[0].close()
        except OSError:
            # another thread took the descriptor, or the client has disconnected
            if not had_spare:
                time.sleep(0.01)  # avoid spinning until one is free
        self._keep_spare()

    def _keep_spare(self) -> None:
        try:
            self._spare = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self._spare = None

    def _drop_spare(self) -> None:
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None


def open_listener(host: str, port: int) -> ListeningSocket:
    """Bind a listening socket.

    Raises
    ------
    OSError
        the port cannot be used; the message contains a remedy.
    """
    listener = ListeningSocket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise OSError(
            f"Port {port} on {host} cannot be used ({error.strerror}); choose another with --port."
        ) from None
    return listener


def make_room(connections: int) -> int:
    """Raise the descriptor limit for this many connections; return the number that fits."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return connections
    descriptors = RESERVED + PER_CONNECTION * connections
    if soft < descriptors:
        soft = descriptors if hard == resource.RLIM_INFINITY else min(descriptors, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    # a limit below the reserve is covered by the listener's spare descriptor
    room = max((soft - RESERVED) // PER_CONNECTION, soft // (2 * PER_CONNECTION))
    if room < connections:
        log.warning(
            "The system allows %d open files (ulimit -n): at most %d connections are served, not %d.",
            soft,
            room,
            connections,
        )
    return min(room, connections)
