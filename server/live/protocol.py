"""Messages between tablet and server on a live socket, other than batches (docs/reference/live-protocol.md).

Malformed messages are reported with a code. Independent of sockets, clocks and disks.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, Literal

from sagittal.core.errors import InputError
from sagittal.core.formats.json_tree import read_json
from sagittal.core.formats.live_log import (
    MOST_FRAME_BYTES,
    Finish,
    Hello,
    SampleBatch,
    batch_of_json,
    finish_of,
    hello_of,
)
from sagittal.core.message import Message

MAX_UNACKED: Final = 64
"""Unacknowledged batches after which a tablet must wait."""
MOST_UNACKED: Final = 2 * MAX_UNACKED
"""A tablet with more unacknowledged batches is disconnected."""
HELLO_WITHIN_S: Final = 10.0
"""Time limit for the hello of a socket."""
MOST_MESSAGE_BYTES: Final = MOST_FRAME_BYTES


class CloseCode(IntEnum):
    """Close codes of a live socket: RFC 6455 below 4000, otherwise 4000 + a suitable HTTP status."""

    DONE = 1000
    GOING_AWAY = 1001
    TOO_BIG = 1009
    MALFORMED = 4400
    UNAUTHORISED = 4401
    NO_HELLO = 4408
    GAP = 4409
    ENDED = 4410
    REPLACED = 4412
    TOO_MANY = 4429
    STORAGE = 4507


FINAL: Final = frozenset(
    {CloseCode.TOO_BIG, CloseCode.MALFORMED, CloseCode.UNAUTHORISED, CloseCode.ENDED, CloseCode.REPLACED}
)
"""Close codes after which a client must not reconnect with the same messages; after others it resumes."""


class ProtocolError(InputError):
    """A rejected message: `code` and `message` give the reason, `close` is the close code."""

    def __init__(self, code: str, message: str, close: CloseCode = CloseCode.MALFORMED) -> None:
        super().__init__(code, message)
        self.close = close

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.code, self.message, self.close)


@dataclass(frozen=True)
class Battery:
    """Battery level by sensor id, 0 to 100 %."""

    percent: Mapping[str, float]


Said = Hello | SampleBatch | Finish | Battery
"""A text message from the tablet."""


def parse(text: str) -> Said:
    """Parse a text message.

    Raises
    ------
    ProtocolError
        message_too_big, message_bad_json, message_unknown, battery_bad, and the codes of hello, batch and
        finish (core/formats/live_log.py, live_hello.py).
    """
    check_size(text)
    try:
        root: Any = read_json(text)
    except ValueError as error:
        raise ProtocolError("message_bad_json", f"The message is not valid JSON: {error}.") from None
    kind = root.get("type") if isinstance(root, dict) else None
    try:
        match kind:
            case "hello":
                return hello_of(root)
            case "batch":
                return batch_of_json(root)
            case "finish":
                return finish_of(root)
            case "battery":
                return _battery(root)
    except InputError as error:
        raise ProtocolError(error.code, error.message) from None
    kind_text = repr(kind)[:40]
    raise ProtocolError(
        "message_unknown", f"The message's type is {kind_text}; expected hello, batch, finish or battery."
    )


def check_size(message: bytes | str) -> None:
    """Reject a message above 1 MiB.

    Raises
    ------
    ProtocolError `message_too_big`.
    """
    if len(message) > MOST_MESSAGE_BYTES:
        raise ProtocolError(
            "message_too_big",
            f"A message of {len(message)} bytes came, at most {MOST_MESSAGE_BYTES} are taken; "
            "send fewer samples in a batch.",
            CloseCode.TOO_BIG,
        )


def _battery(root: Mapping[str, Any]) -> Battery:
    sensors = root.get("sensors")
    if not isinstance(sensors, dict) or len(sensors) > 64:
        raise InputError("battery_bad", "A battery message has no `sensors`; expected {id: percent}.")
    for name, value in sensors.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 100:
            raise InputError(
                "battery_bad",
                Message(
                    "The battery of {name:.40} is {value:.40}; expected 0 to 100.",
                    name=name,
                    value=repr(value),
                ),
            )
    return Battery({name: float(value) for name, value in sensors.items()})


def welcome(next_seq: int) -> str:
    """Reply to hello: all batches below are durable, continue with this one."""
    return _text("welcome", next_seq=next_seq, max_unacked=MAX_UNACKED)


def ack(seq: int) -> str:
    """Acknowledge: all batches below this one are durable."""
    return _text("ack", ack=seq)


def error(code: str, detail: str, **more: object) -> str:
    """Message that reports an error."""
    return _text("error", code=code, detail=detail, **more)


def command(name: Literal["start", "stop"]) -> str:
    """Command from the therapist to the tablet."""
    return _text("command", command=name)


def state(stage: str, say: str | None = None) -> str:
    """Stage of the estimation (waiting, stand, walk, running), for the tablet's instructions.

    Parameters
    ----------
    say : current instruction of a guided test; takes precedence over the stage.
    """
    return _text("state", stage=stage) if say is None else _text("state", stage=stage, say=say)


def judge_calibration(verdict: Mapping[str, Any]) -> str:
    """Outcome of the calibration, with reasons and remedies (`wire.judge_calibration`)."""
    return _text("calibration", **verdict)


def announce_finish(recording: str, problem: str | None = None) -> str:
    """The trial is stored as a recording; `problem` (finish_mismatch): despite a mismatch at its end."""
    return _text("finished", recording=recording, **({"problem": problem} if problem else {}))


def _text(kind: str, **values: object) -> str:
    return json.dumps({"type": kind, **values}, ensure_ascii=False, separators=(",", ":"))
