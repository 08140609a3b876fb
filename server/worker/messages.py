"""Messages between worker and child: MessagePack over a socket pair.

Not pickle: the child reads untrusted files, and a compromised child must not compromise the worker.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import msgspec

from sagittal.core.user_text import encode_user_text


class Input(msgspec.Struct, frozen=True, tag=True):
    """One file of the job, read by the child from the blob store."""

    name: str
    size: int
    sha256: str


class Order(msgspec.Struct, frozen=True, tag=True):
    """Worker to child: a computation to carry out."""

    kind: str
    space: str | None
    files: list[Input]
    params: dict[str, Any]
    checkpoint: str | None = None


class ChildReady(msgspec.Struct, frozen=True, tag=True):
    """Child to worker: all modules are imported and compiled."""


class Stage(msgspec.Struct, frozen=True, tag=True):
    """Child to worker: a stage starts or reports progress."""

    name: str
    fraction: float
    message: str | None = None


class Checkpoint(msgspec.Struct, frozen=True, tag=True):
    """Child to worker: a checkpoint from which another attempt can resume."""

    content: bytes


class Result(msgspec.Struct, frozen=True, tag=True):
    """Child to worker: the result files."""

    files: dict[str, bytes]


class Failure(msgspec.Struct, frozen=True, tag=True):
    """Child to worker: no result, with the reason; `passing` = temporary, to be retried."""

    code: str
    message: str
    passing: bool = False


Reply = ChildReady | Stage | Checkpoint | Result | Failure

encode = partial(msgspec.msgpack.encode, enc_hook=encode_user_text)
decode_order = msgspec.msgpack.Decoder(Order).decode
decode_reply = msgspec.msgpack.Decoder(Reply).decode
