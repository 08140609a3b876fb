"""A network between browser and server that a test can cut: a TCP relay on its own port."""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
from urllib.parse import urlsplit


class Network:
    """Relays connections to a server while it is up; down, it ends those there are and takes no more."""

    def __init__(self, url: str) -> None:
        self.lead_to(url)
        self._door = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._door.getsockname()[1]}"
        self._up = True
        self._frozen = threading.Event()
        self._pairs: set[socket.socket] = set()
        self._lock = threading.Lock()
        threading.Thread(target=self._listen, daemon=True).start()

    def lead_to(self, url: str) -> None:
        """Relay new connections to this server."""
        parts = urlsplit(url)
        self._target = (parts.hostname or "127.0.0.1", parts.port or 80)

    def cut(self) -> None:
        """End all connections and refuse new ones."""
        with self._lock:
            self._up = False
            pairs, self._pairs = self._pairs, set()
        for one in pairs:
            _shut(one)

    def freeze(self) -> None:
        """Let nothing through without ending anything, as a wall does to radio."""
        self._frozen.set()

    def mend(self) -> None:
        """Restore the connection; frozen data stay lost."""
        if self._frozen.is_set():
            self.cut()
            self._frozen.clear()
        self._up = True

    def close(self) -> None:
        """Go."""
        self.cut()
        _shut(self._door)

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._door.accept()
                if self._frozen.is_set():
                    with self._lock:
                        self._pairs.add(near)
                elif self._up:
                    threading.Thread(target=self._relay, args=(near,), daemon=True).start()
                else:
                    _shut(near)

    def _relay(self, near: socket.socket) -> None:
        with contextlib.suppress(OSError), near, socket.create_connection(self._target, 5) as far:
            with self._lock:
                if not self._up:
                    return
                self._pairs |= {near, far}
            with selectors.DefaultSelector() as ready:
                ready.register(near, selectors.EVENT_READ, far)
                ready.register(far, selectors.EVENT_READ, near)
                while True:
                    for key, _ in ready.select():
                        data = key.fileobj.recv(1 << 16)  # type: ignore[union-attr]
                        if not data:
                            return
                        if not self._frozen.is_set():
                            key.data.sendall(data)


def _shut(one: socket.socket) -> None:
    with contextlib.suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)
    one.close()
