"""Client of the live protocol: buffers batches until acknowledged, resumes, and finishes with a hash.

Python counterpart of the tablet page's JavaScript, for `sagittal replay`, the demo, tests and load
generators.
"""

from __future__ import annotations

import asyncio
import random
import time
from collections.abc import AsyncIterable, Callable, Mapping
from typing import Any, Final

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus
from websockets.typing import Subprotocol

from sagittal.core.formats.live_log import PROTOCOL, Hello, hello_json
from sagittal.server.live.protocol import FINAL, MOST_MESSAGE_BYTES
from sagittal.server.live.sender import LiveError, Sender, StreamFaults, StreamReport

__all__ = ["LiveError", "StreamFaults", "StreamReport", "stream"]

FIRST_PAUSE_S: Final = 0.1
LONGEST_PAUSE_S: Final = 2.0
"""Maximum pause before reconnecting, doubled after each failure."""

SILENCE_S: Final = 5.0
"""A connection without response for this long is replaced."""


async def stream(
    url: str,
    token: str,
    hello: Hello,
    frames: AsyncIterable[bytes],
    *,
    faults: StreamFaults | None = None,
    patience_s: float = 60.0,
    hear: Callable[[Mapping[str, Any]], None] = lambda _: None,
    seed: int | None = None,
    report: StreamReport | None = None,
) -> StreamReport:
    """Stream a trial and finish it.

    Parameters
    ----------
    url : of the socket, ws:// or wss://. frames : encoded batches, seq from 0; the sender sets their pace.
    patience_s : timeout without an acknowledgement while batches are unacknowledged.
    hear : called with the server's commands and states. seed : of the faults.
    report : updated during streaming, for observers.

    Raises
    ------
    LiveError
        the server's code, or one of ours.
    """
    chance = random.Random(seed)  # noqa: S311 - of faults, not of secrets
    sender = Sender(
        hello_json(hello, token).decode(),
        faults or StreamFaults(),
        hear,
        chance,
        StreamReport() if report is None else report,
    )
    producing = sender.start(frames)
    try:
        await _until_finished(sender, url, patience_s)
    finally:
        producing.cancel()
        await asyncio.gather(producing, return_exceptions=True)
    return sender.report


async def _until_finished(sender: Sender, url: str, patience_s: float) -> None:
    pause, trouble = FIRST_PAUSE_S, ""
    while not sender.finished:
        progress_before = sender.progress
        try:
            async with connect(
                url,
                subprotocols=[Subprotocol(PROTOCOL)],
                compression=None,
                proxy=None,
                max_size=MOST_MESSAGE_BYTES,
                open_timeout=10,
                close_timeout=2,
                ping_interval=SILENCE_S / 2,  # a broken network connection is not reported
                ping_timeout=SILENCE_S / 2,
            ) as ws:
                await sender.serve(ws)
        except ConnectionClosed as closed:
            code, reason = (closed.rcvd.code, closed.rcvd.reason) if closed.rcvd else (1006, "")
            trouble = f"closed with {code} {reason}".rstrip()
            if code in FINAL:
                raise LiveError(reason or f"closed_{code}", sender.said or f"The server {trouble}.") from None
        except InvalidStatus as refused:
            status = refused.response.status_code
            trouble = f"answered HTTP {status}"
            if status < 500:
                raise LiveError("refused_connection", f"{url} {trouble}; is it a Sagittal server?") from None
        except (OSError, TimeoutError, InvalidHandshake) as error:
            trouble = str(error) or type(error).__name__
        if sender.finished:
            return
        if sender.progress > progress_before:
            pause = FIRST_PAUSE_S
        elif time.monotonic() - sender.progressed_at > patience_s:
            raise LiveError(
                "unreachable",
                f"{url} has acknowledged nothing for {patience_s:g} s ({trouble}); "
                f"{sender.waiting} batches are not kept.",
            )
        await asyncio.sleep(pause)
        pause = min(2 * pause, LONGEST_PAUSE_S)
