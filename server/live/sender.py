"""State of a sender of the live protocol: unacknowledged batches, and the position of a connection in
them.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import hashlib
import random
import time
from collections import deque
from collections.abc import AsyncIterable, Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from sagittal.core.errors import SagittalError
from sagittal.core.formats.json_tree import read_json
from sagittal.core.formats.live_log import Finish, finish_json, read_batch_header, view_samples


class LiveError(SagittalError):
    """The stream cannot continue; `code` is the server's or one of ours.

    unreachable (nothing acknowledged before the timeout), refused_connection, take_ended (on the server),
    other_sender (the trial contains batches of another client), acknowledged_lost (the server requests
    batches it had acknowledged).
    """


@dataclass(frozen=True)
class StreamFaults:
    """Faults injected for testing.

    Parameters
    ----------
    drop : probability per batch of dropping the connection instead. jitter_s : maximum delay of a batch.
    """

    drop: float = 0.0
    jitter_s: float = 0.0


@dataclass
class StreamReport:
    """Statistics of a stream.

    Parameters
    ----------
    sent : distinct batches. resent : repeated after a reconnect. reconnects : number of reconnects.
    ack_s : per batch, time from first transmission to acknowledgement.
    sha256 : over all payloads. recording : id of the stored recording, None before the finish.
    problem : code of a problem at the finish (finish_mismatch), None = none.
    """

    sent: int = 0
    resent: int = 0
    reconnects: int = 0
    ack_s: list[float] = field(default_factory=list)
    sha256: str = ""
    recording: str | None = None
    problem: str | None = None

    def ack_quantile(self, share: float) -> float:
        """Quantile of the acknowledgement times; NaN without any."""
        ranked = sorted(self.ack_s)
        return ranked[min(len(ranked) - 1, int(share * len(ranked)))] if ranked else float("nan")


def _over(ws: ClientConnection, sending: asyncio.Task[None]) -> None:
    if not sending.cancelled():  # dropped deliberately, or the source failed
        ws.transport.abort()


class Sender:
    """Unacknowledged batches, and the position of this connection in them."""

    def __init__(
        self,
        hello: str,
        faults: StreamFaults,
        hear: Callable[[Mapping[str, Any]], None],
        chance: random.Random,
        report: StreamReport,
    ) -> None:
        self.report = report
        self.finished = False
        self.said = ""
        self.progress = 0
        self.progressed_at = time.monotonic()
        self._hello, self._faults, self._hear, self._chance = hello, faults, hear, chance
        self._kept: deque[bytes] = deque()
        self._first_sent: deque[float] = deque()
        self._acked = 0
        self._at = 0
        self._most = 0
        self._welcome = False
        self._finish_sent = False  # on this connection
        self._finish_said = False  # on any connection
        self._connections = 0
        self._hash = hashlib.sha256()
        self._changed = asyncio.Event()

    @property
    def waiting(self) -> int:
        """Unacknowledged batches."""
        return len(self._kept)

    @property
    def _produced(self) -> int:
        return self._acked + len(self._kept)

    def start(self, frames: AsyncIterable[bytes]) -> asyncio.Task[None]:
        """Start buffering batches, connected or not."""
        self._producing = asyncio.create_task(self._produce(frames))
        self._producing.add_done_callback(lambda _: self._changed.set())
        return self._producing

    async def _produce(self, frames: AsyncIterable[bytes]) -> None:
        async for frame in frames:
            self._hash.update(view_samples(frame, read_batch_header(frame)))
            if not self._kept:
                self.progressed_at = time.monotonic()  # nothing to acknowledge before
            self._kept.append(frame)
            self._changed.set()
        self.report.sha256 = self._hash.hexdigest()

    async def serve(self, ws: ClientConnection) -> None:
        """Send over one connection until the trial is finished or the connection ends."""
        self._welcome = False
        await ws.send(self._hello)
        while not self._welcome and not self.finished:
            self._heed(await ws.recv())
        self.report.reconnects += self._connections > 0
        self._connections += 1
        sending = asyncio.create_task(self._send(ws))
        sending.add_done_callback(functools.partial(_over, ws))
        try:
            while not self.finished:
                self._heed(await ws.recv())
        finally:
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionClosed):
                await sending

    async def _send(self, ws: ClientConnection) -> None:
        while True:
            while self._at < self._produced and self._at - self._acked < self._most:
                if self._faults.jitter_s:
                    await asyncio.sleep(self._chance.uniform(0.0, self._faults.jitter_s))
                if self._chance.random() < self._faults.drop:
                    ws.transport.abort()
                    return
                await self._send_one(ws)
            if self._producing.done():
                self._producing.result()  # an error of the source ends the stream
                if self._at == self._produced and not self._finish_sent:
                    self._finish_sent = self._finish_said = True
                    await ws.send(finish_json(Finish(self._produced, self.report.sha256)).decode())
            await self._changed.wait()
            self._changed.clear()

    async def _send_one(self, ws: ClientConnection) -> None:
        # during this wait (jitter, full socket), acknowledgements may move the window
        place = self._at - self._acked
        if place < 0:
            self._at = self._acked
            return
        frame = self._kept[place]
        if self._at == self.report.sent:
            self.report.sent += 1
            self._first_sent.append(time.monotonic())
        else:
            self.report.resent += 1
        self._at += 1
        await ws.send(frame)

    def _heed(self, text: bytes | str) -> None:
        message: Any = read_json(text)
        match message.get("type"):
            case "welcome":
                self._welcomed(int(message["next_seq"]), int(message["max_unacked"]))
            case "ack":
                self._acknowledged(int(message["ack"]))
            case "finished":
                self._finished(message)
            case "error":
                self.said = str(message.get("detail", ""))
                if message.get("code") == "finish_mismatch" and "next_seq" in message:
                    self._at, self._finish_sent = max(int(message["next_seq"]), self._acked), False
                else:
                    self._most = 0  # nothing more is sent on this connection
            case _:
                self._hear(message)
        self._changed.set()

    def _welcomed(self, next_seq: int, most: int) -> None:
        if next_seq < self._acked:
            raise LiveError(
                "acknowledged_lost",
                f"The server asks for batch {next_seq} again, which it had acknowledged; the data folder is "
                "not the one it was.",
            )
        if next_seq > self.report.sent:
            raise LiveError(
                "other_sender",
                f"The take holds {next_seq} batches already, this client has sent {self.report.sent}; begin "
                "a new take.",
            )
        self._acknowledged(next_seq)
        self._at, self._most, self._finish_sent, self._welcome = next_seq, most, False, True

    def _finished(self, message: Mapping[str, Any]) -> None:
        if not self._finish_said:
            raise LiveError(
                "take_ended",
                f"The take was ended by somebody else; {self.waiting} batches were not acknowledged.",
            )
        self._acknowledged(self.report.sent)
        self.report.recording, self.report.problem = str(message["recording"]), message.get("problem")
        self.finished = True

    def _acknowledged(self, seq: int) -> None:
        now = time.monotonic()
        while self._acked < seq and self._first_sent:
            self._kept.popleft()
            self.report.ack_s.append(now - self._first_sent.popleft())
            self._acked += 1
            self._advance()

    def _advance(self) -> None:
        self.progress += 1
        self.progressed_at = time.monotonic()
