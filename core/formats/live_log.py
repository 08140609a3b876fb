"""Batches of the live protocol and the log of a recording: `sagittal.live.v1` as bytes
(docs/reference/live-protocol.md).

A batch contains consecutive samples of one device clock. The log is the file mark and records (u32 length,
u32 crc32, body) with body[0] = H hello, B batch as received, F finish. It is written during the recording and
is itself the stored recording afterwards; everything live is a function of its records in order.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import InputError
from sagittal.core.formats.json_tree import read_json
from sagittal.core.formats.live_hello import (
    PROTOCOL,
    Clock,
    Hello,
    SensorInfo,
    Source,
    StreamInfo,
    hello_json,
    hello_of,
    parse_hello,
)

__all__ = [
    "FILE_MARK",
    "MOST_FRAME_BYTES",
    "PROTOCOL",
    "RECORD_HEAD",
    "RECORD_STARTS",
    "Clock",
    "Finish",
    "Header",
    "Hello",
    "LogRecord",
    "SampleBatch",
    "SensorInfo",
    "Source",
    "StreamInfo",
    "batch_of_json",
    "check_fits",
    "decode_batch",
    "encode_batch",
    "finish_json",
    "hello_json",
    "hello_of",
    "is_whole_length",
    "parse_finish",
    "parse_hello",
    "read_batch_header",
    "record",
    "scan",
    "scan_records",
    "view_samples",
]

MAGIC: Final = 0x314C4753
"""The bytes "SGL1"."""
CHANNELS: Final = 9
"""acc, gyr, mag, three axes each; NaN = not measured."""
HAS_OFFSETS: Final = 1
MOST_SAMPLES: Final = 1000
MOST_FRAME_BYTES: Final = 1 << 20
LATEST_US: Final = 1 << 53
"""Clocks must fit the whole numbers of JavaScript; 285 years."""

FILE_MARK: Final = b"SAGLIVE1\n"
KINDS: Final = b"HBF"

_HEAD: Final = struct.Struct("<IHHHHQQQ")
_CRC: Final = struct.Struct("<I")
_RECORD: Final = struct.Struct("<II")
RECORD_HEAD: Final = _RECORD.size
"""Bytes of a record before its kind's letter."""
RECORD_STARTS: Final = (b"B" + _CRC.pack(MAGIC), b'F{"')
"""How the bodies of records begin that may follow others: where to look for one behind damage."""

Buffer = bytes | bytearray | memoryview
Kind = Literal["H", "B", "F"]


class Header(NamedTuple):
    """Header of a batch; times in µs of the device's and of the sender's clock."""

    flags: int
    n_imu: int
    n_samples: int
    stream: int
    seq: int
    t0_us: int
    sent_us: int


@dataclass(frozen=True, eq=False)
class SampleBatch:
    """Consecutive samples of one stream.

    Parameters
    ----------
    seq : one sequence per recording over all streams. t0_us : device clock of the first sample. sent_us : the
        sender's monotonic clock at the first transmission.
    samples : (n, k, 9) float32, acc m/s², gyr rad/s, mag, of the stream's k sensors; NaN = not measured.
    offsets_us : (n,) uint32 from t0, None = evenly spaced by the stream's rate.
    """

    stream: int
    seq: int
    t0_us: int
    sent_us: int
    samples: NDArray[np.float32]
    offsets_us: NDArray[np.uint32] | None = None


@dataclass(frozen=True)
class Finish:
    """Final message of the sender: number of batches, and SHA-256 over the payloads in order of seq."""

    count: int
    sha256: str


class LogRecord(NamedTuple):
    """One record of a log: its kind, the content after the kind's letter, and its end in the data."""

    kind: Kind
    body: bytes
    end: int


def encode_batch(batch: SampleBatch) -> bytes:
    """Encode a batch as a frame for transmission.

    Raises
    ------
    InputError `batch_shape`, `batch_time`, as `read_batch_header` would.
    """
    samples = np.ascontiguousarray(batch.samples, "<f4")
    if samples.ndim != 3 or samples.shape[2] != CHANNELS:
        raise InputError("batch_shape", f"Samples have shape {samples.shape}; expected (n, sensors, 9).")
    n, k = samples.shape[:2]
    offsets = b""
    if batch.offsets_us is not None:
        if batch.offsets_us.shape != (n,):
            raise InputError("batch_shape", f"{batch.offsets_us.shape} offsets for {n} samples.")
        offsets = np.ascontiguousarray(batch.offsets_us, "<u4").tobytes()
    flags = HAS_OFFSETS if batch.offsets_us is not None else 0
    _check(Header(flags, k, n, batch.stream, batch.seq, batch.t0_us, batch.sent_us))
    head = _HEAD.pack(MAGIC, flags, k, n, batch.stream, batch.seq, batch.t0_us, batch.sent_us)
    body = b"".join((head, samples.tobytes(), offsets))
    return body + _CRC.pack(crc32(body))


def read_batch_header(frame: Buffer) -> Header:
    """Validate a frame's mark, shape and checksum and return its header; samples are not inspected.

    Raises
    ------
    InputError `batch_magic`, `batch_shape`, `batch_time`, `batch_checksum`.
    """
    if len(frame) < _HEAD.size + _CRC.size:
        raise InputError("batch_shape", f"A frame of {len(frame)} bytes is shorter than the header.")
    magic, *fields = _HEAD.unpack_from(frame)
    if magic != MAGIC:
        raise InputError(
            "batch_magic", f"The frame starts with {magic:#010x}; expected {MAGIC:#010x} (SGL1)."
        )
    header = Header(*fields)
    expected = _check(header)
    if len(frame) != expected:
        raise InputError(
            "batch_shape",
            f"Batch {header.seq} has {len(frame)} bytes; {header.n_samples} samples of {header.n_imu} "
            f"sensors make {expected}.",
        )
    (crc,) = _CRC.unpack_from(frame, expected - _CRC.size)
    if crc32(memoryview(frame)[: -_CRC.size]) != crc:
        raise InputError("batch_checksum", f"Batch {header.seq} was damaged on its way; send it again.")
    return header


def _check(header: Header) -> int:
    """Length of a frame with this header, or the reason why it is invalid."""
    if header.flags & ~HAS_OFFSETS or not 1 <= header.n_samples <= MOST_SAMPLES or header.n_imu < 1:
        raise InputError(
            "batch_shape",
            f"Batch {header.seq}: flags {header.flags}, {header.n_samples} samples, {header.n_imu} sensors; "
            f"expected flags 0 or 1, 1 to {MOST_SAMPLES} samples, 1 sensor or more.",
        )
    per_sample = 4 * CHANNELS * header.n_imu + (4 if header.flags else 0)
    length = _HEAD.size + header.n_samples * per_sample + _CRC.size
    if length > MOST_FRAME_BYTES:
        raise InputError("batch_shape", f"Batch {header.seq} has {length} bytes, at most {MOST_FRAME_BYTES}.")
    if max(header.seq, header.t0_us, header.sent_us) >= LATEST_US:
        raise InputError("batch_time", f"Batch {header.seq}: a clock or seq is beyond 2^53.")
    return length


def check_fits(header: Header, hello: Hello) -> StreamInfo:
    """The stream of a batch.

    Raises
    ------
    InputError `batch_stream` for an unknown one, `batch_shape` if the number of sensors differs.
    """
    info = hello.stream(header.stream)
    if header.n_imu != len(info.sensors):
        raise InputError(
            "batch_shape",
            f"Batch {header.seq} has {header.n_imu} sensors; stream {header.stream} has {len(info.sensors)}.",
        )
    return info


def decode_batch(frame: Buffer, header: Header | None = None) -> SampleBatch:
    """Decode the batch in a frame; its arrays are views of the frame's memory.

    Parameters
    ----------
    header : from `read_batch_header`, if the frame has already been validated.

    Raises
    ------
    InputError as `read_batch_header`.
    """
    h = header or read_batch_header(frame)
    count = h.n_samples * h.n_imu * CHANNELS
    samples = np.frombuffer(frame, "<f4", count, _HEAD.size).reshape(h.n_samples, h.n_imu, CHANNELS)
    offsets = np.frombuffer(frame, "<u4", h.n_samples, _HEAD.size + 4 * count) if h.flags else None
    return SampleBatch(h.stream, h.seq, h.t0_us, h.sent_us, samples, offsets)


def view_samples(frame: Buffer, header: Header) -> memoryview:
    """The sample bytes, the input of the finish hash."""
    return memoryview(frame)[_HEAD.size : _HEAD.size + 4 * header.n_samples * header.n_imu * CHANNELS]


def batch_of_json(root: Mapping[str, object]) -> SampleBatch:
    """A batch sent as JSON: {"type": "batch", "stream", "seq", "t0_us", "sent_us", "samples"}.

    `samples` is a list of n lists, each with one list of 9 numbers per sensor, null = not measured;
    `offsets_us` is optional.

    Raises
    ------
    InputError `batch_shape`, `batch_time`.
    """
    numbers = [root.get(name) for name in ("stream", "seq", "t0_us", "sent_us")]
    if not all(isinstance(x, int) and not isinstance(x, bool) and x >= 0 for x in numbers):
        raise InputError("batch_shape", "stream, seq, t0_us and sent_us must be whole numbers from 0.")
    stream, seq, t0_us, sent_us = (int(str(x)) for x in numbers)
    if stream >= 1 << 16:
        raise InputError("batch_shape", f"Stream {stream} is above 65535.")
    try:
        with np.errstate(over="ignore"):
            samples = np.array(root.get("samples"), np.float64).astype(np.float32)
        raw_offsets = root.get("offsets_us")
        offsets = None if raw_offsets is None else np.array(raw_offsets, np.uint32)
    except (TypeError, ValueError, OverflowError) as e:
        raise InputError("batch_shape", f"Samples or offsets of batch {seq} are not numbers: {e}.") from e
    batch = SampleBatch(stream, seq, t0_us, sent_us, samples, offsets)
    encode_batch(batch)  # the one place that knows what a frame can hold
    return batch


def parse_finish(data: bytes | str) -> Finish:
    """Parse {"type": "finish", "count", "sha256"}.

    Raises
    ------
    InputError `finish_bad`.
    """
    try:
        root = read_json(data)
    except ValueError as e:
        raise InputError("finish_bad", f"The finish is not valid JSON: {e}.") from e
    return finish_of(root)


def finish_of(root: object) -> Finish:
    """Build a finish from decoded JSON; errors as in `parse_finish`."""
    count = root.get("count") if isinstance(root, dict) else None
    digest = root.get("sha256") if isinstance(root, dict) else None
    if isinstance(count, bool) or not isinstance(count, int) or not 0 <= count < LATEST_US:
        raise InputError("finish_bad", "The finish has no count; expected the number of batches.")
    if not isinstance(digest, str) or len(digest) != 64 or set(digest) - set("0123456789abcdef"):
        raise InputError("finish_bad", "The finish has no sha256; expected 64 hexadecimal digits.")
    return Finish(count, digest)


def finish_json(finish: Finish) -> bytes:
    """The JSON sent by the tablet and stored in the log."""
    return json.dumps(
        {"type": "finish", "count": finish.count, "sha256": finish.sha256}, separators=(",", ":")
    ).encode()


def record(kind: Kind, body: Buffer) -> bytes:
    """Encode one record of the log."""
    whole = b"".join((kind.encode(), body))
    return _RECORD.pack(len(whole), crc32(whole)) + whole


def is_whole_length(head: bytes, size: int) -> bool:
    """Whether a record with these first RECORD_HEAD bytes would fit into `size` bytes."""
    if len(head) < _RECORD.size:
        return False
    length: int = _RECORD.unpack(head)[0]
    return 1 <= length <= min(MOST_FRAME_BYTES + 1, size - _RECORD.size)


def scan(data: Buffer, start: int = 0) -> tuple[list[LogRecord], int]:
    """The complete records of a log, and the number of bytes up to the end of the last one.

    Parameters
    ----------
    start : 0 = the file mark, any other = the beginning of a record.

    Returns
    -------
    Data after that length are truncated or damaged; 0 if even the file mark is incomplete.
    """
    if start == 0:
        if bytes(data[: len(FILE_MARK)]) != FILE_MARK:
            return [], 0
        start = len(FILE_MARK)
    return scan_records(data, start)


def scan_records(data: Buffer, start: int = 0) -> tuple[list[LogRecord], int]:
    """As `scan` for data that begins with a record at `start`, such as the new end of a log."""
    view, records = memoryview(data), []
    while len(view) - start >= _RECORD.size:
        length, crc = _RECORD.unpack_from(view, start)
        first = start + _RECORD.size
        if not 1 <= length <= MOST_FRAME_BYTES + 1 or length > len(view) - first:
            break
        body = view[first : first + length]
        if body[0] not in KINDS or crc32(body) != crc:
            break
        start = first + length
        kind: Kind = chr(body[0])  # type: ignore[assignment]
        records.append(LogRecord(kind, bytes(body[1:]), start))
    return records, start
