"""Length-prefixed messages between two of our processes over a socket pair.

The encoding of messages is up to the caller (MessagePack throughout; not pickle, since a child reads
untrusted files and a compromised child must not compromise its parent).
"""

from __future__ import annotations

import asyncio
import select
import socket
import struct
from math import ceil

_LENGTH = struct.Struct("!Q")
_PIECE_BYTES = 1 << 20


def frame(message: bytes) -> bytes:
    """Return the bytes sent for one message."""
    return _LENGTH.pack(len(message)) + message


async def read_message(reader: asyncio.StreamReader) -> bytes:
    """Return the next message on the event loop; raises IncompleteReadError if the peer has closed."""
    (length,) = _LENGTH.unpack(await reader.readexactly(_LENGTH.size))
    return await reader.readexactly(length)


class Channel:
    """One end of the connection, for blocking use in a thread.

    Never reads past the message it returns, so `poll` on `fileno` indicates whether another is available.

    Parameters
    ----------
    end : a connected socket; the channel closes it.
    """

    def __init__(self, end: socket.socket) -> None:
        self._socket = end

    def fileno(self) -> int:
        """Return the file descriptor, for `select`."""
        return self._socket.fileno()

    def send(self, message: bytes) -> None:
        """Send a message; blocks while the peer does not read; raises OSError if it has closed."""
        self._socket.sendall(_LENGTH.pack(len(message)))
        self._socket.sendall(message)

    def has_message(self, timeout_s: float) -> bool:
        """Wait for a message up to a timeout; also true if the peer has closed."""
        waiting = select.poll()
        waiting.register(self._socket, select.POLLIN)
        return bool(waiting.poll(ceil(1000.0 * timeout_s)))

    def receive(self) -> bytes:
        """Block until the next message and return it; raises EOFError if the peer has closed."""
        (length,) = _LENGTH.unpack(self._read(_LENGTH.size))
        return self._read(length)

    def close(self) -> None:
        """Close the connection; the peer reads end of file."""
        self._socket.close()

    def _read(self, size: int) -> bytes:
        content = bytearray(size)
        view, done = memoryview(content), 0
        while done < size:
            read = self._socket.recv_into(view[done : done + _PIECE_BYTES])
            if not read:
                raise EOFError
            done += read
        return bytes(content)
