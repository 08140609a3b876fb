"""Messages between two of our processes: a socket pair, each message with its length before it.

The bytes of a message are the business of who sends it (MessagePack everywhere; not pickle: a child reads
files from outside, and who got hold of it must not get hold of its parent too).
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
    """Return what goes over the line for one message."""
    return _LENGTH.pack(len(message)) + message


async def read_message(reader: asyncio.StreamReader) -> bytes:
    """Return the next message on the event loop; raises IncompleteReadError when the other side has gone."""
    (length,) = _LENGTH.unpack(await reader.readexactly(_LENGTH.size))
    return await reader.readexactly(length)


class Channel:
    """One end of the line, for a thread that may wait.

    It reads no further than the message it returns, so that `poll` on `fileno` tells whether one is there.

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
        """Send a message; waits while the other side does not read; raises OSError when it has gone."""
        self._socket.sendall(_LENGTH.pack(len(message)))
        self._socket.sendall(message)

    def has_message(self, timeout_s: float) -> bool:
        """Wait for a message, at most so long; also true when the other side has gone."""
        waiting = select.poll()
        waiting.register(self._socket, select.POLLIN)
        return bool(waiting.poll(ceil(1000.0 * timeout_s)))

    def receive(self) -> bytes:
        """Return the next message, however long it takes; raises EOFError when the other side has gone."""
        (length,) = _LENGTH.unpack(self._read(_LENGTH.size))
        return self._read(length)

    def close(self) -> None:
        """Let go of the line; the other side reads its end."""
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
