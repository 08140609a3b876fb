"""Messages over the line between two of our processes."""

from __future__ import annotations

import asyncio
import threading
from socket import socketpair

import pytest

from sagittal.server.processes.channel import Channel, frame, read_message


def test_messages_of_any_length_arrive_whole_and_in_order() -> None:
    left, right = (Channel(end) for end in socketpair())
    sent = [b"", b"x", bytes(range(256)) * 40_000]

    def send() -> None:
        for message in sent:
            left.send(message)

    sender = threading.Thread(target=send)
    sender.start()
    assert [right.receive() for _ in sent] == sent
    sender.join()
    assert not right.has_message(0.0)
    left.close()
    assert right.has_message(0.0)
    with pytest.raises(EOFError):
        right.receive()
    right.close()


def test_both_ends_frame_alike_and_a_message_that_breaks_off_is_none() -> None:
    async def read() -> bytes:
        ours, theirs = socketpair()
        reader, writer = await asyncio.open_connection(sock=ours)
        channel = Channel(theirs)
        channel.send(b"down")
        writer.write(frame(b"up"))
        await writer.drain()
        assert await asyncio.to_thread(channel.receive) == b"up"
        got = await read_message(reader)
        writer.write(frame(b"half a message")[:-3])
        writer.close()
        await writer.wait_closed()
        with pytest.raises(EOFError):
            await asyncio.to_thread(channel.receive)
        channel.close()
        return got

    assert asyncio.run(read()) == b"down"
