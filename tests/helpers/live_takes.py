"""A small live take: its hello and frames that any test can check byte by byte."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from sagittal.core.formats.live_log import (
    Finish,
    Hello,
    SampleBatch,
    SensorInfo,
    StreamInfo,
    encode_batch,
    finish_json,
    read_batch_header,
    scan,
    view_samples,
)
from sagittal.server.live.intake import TakeEnd
from sagittal.server.live.protocol import ProtocolError
from sagittal.server.storage import segments

HELLO = Hello(
    take="7" * 32,
    source="cli",
    streams=(
        StreamInfo(0, 100.0, "shared", (SensorInfo("A1", "pelvis", 160.0, 35.0), SensorInfo("A2", "foot_l"))),
        StreamInfo(3, 50.0, "own", (SensorInfo("B1", "foot_r"),)),
    ),
)


def frame(seq: int, n: int = 3, stream: int | None = None, sent_us: int | None = None) -> bytes:
    """Batch `seq` of the take; the same numbers give the same bytes."""
    number = (3 if seq % 4 == 3 else 0) if stream is None else stream
    k = {0: 2, 3: 1}.get(number, 1)
    samples = np.random.default_rng(seq).normal(size=(n, k, 9)).astype(np.float32)
    samples[0, 0, 6:] = np.nan
    offsets = np.arange(n, dtype=np.uint32) * 20_001 if number == 3 else None
    t0 = seq * 30_000
    return encode_batch(SampleBatch(number, seq, t0, t0 if sent_us is None else sent_us, samples, offsets))


def digest(frames: list[bytes]) -> str:
    """Hash over the payloads, as the tablet takes it."""
    whole = hashlib.sha256()
    for one in frames:
        whole.update(view_samples(one, read_batch_header(one)))
    return whole.hexdigest()


def finish_text(frames: list[bytes]) -> str:
    return finish_json(Finish(len(frames), digest(frames))).decode()


def stored(path: Path) -> list[bytes]:
    """Batches of a log as received."""
    return [one.body for _, one in segments.read_records(path) if one.kind == "B"]


def kept_in(log: bytes) -> list[bytes]:
    """The batches of a whole log in memory."""
    result, used = scan(log)
    assert used == len(log)
    return [one.body for one in result if one.kind == "B"]


class Heard:
    """A listener that remembers."""

    def __init__(self) -> None:
        self.sizes: list[int] = []
        self.acks: list[int] = []
        self.ends: list[TakeEnd] = []
        self.failures: list[ProtocolError] = []

    def note_growth(self, size: int) -> None:
        self.sizes.append(size)

    def note_acknowledged(self, limit: int) -> None:
        self.acks.append(limit)

    def note_end(self, end: TakeEnd) -> None:
        self.ends.append(end)

    def note_failure(self, error: ProtocolError) -> None:
        self.failures.append(error)
