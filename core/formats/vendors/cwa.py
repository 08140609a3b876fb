"""Axivity AX3 and AX6: CWA files, read block by block.

A header of 1024 bytes, then blocks of 512 with 40 to 120 samples each, a clock reading and a checksum, as
documented by the manufacturer (Open Movement, "AX3 technical documentation", "CWA File Data Blocks").
Acceleration in g, packed in 32 bits per sample or as 16-bit numbers; with an AX6 preceded by the gyroscope.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats.draft import Draft
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock

LABEL: Final = "Axivity CWA"
MAGIC: Final = b"MD\xfc\x03"
HEADER: Final = 1024
BLOCK: Final = 512
MOST_SAMPLES: Final = 120
"""Of a block: packed ones."""
AT_ONCE: Final = 128
"""Blocks that are decoded together, some ten thousand samples."""

TAIL: Final = 1024
"""So many blocks at the end are looked through for the last whole one."""

GAP: Final = 1.5
"""A block that begins later than so many of its own lengths after the one before follows a hole [our
choice]."""

_BLOCK: Final = np.dtype(
    {
        "names": ["kind", "length", "fraction", "clock", "light", "rate", "axes", "offset", "count"],
        "formats": ["<u2", "<u2", "<u2", "<u4", "<u2", "u1", "u1", "<i2", "<u2"],
        "offsets": [0, 2, 4, 14, 18, 24, 25, 26, 28],
        "itemsize": BLOCK,
    }
)  # fmt: skip
_KIND: Final = 0x5841
_LENGTH: Final = 508
_DATA: Final = 30
_SUMMED: Final = 65536

Opener = Callable[[], BinaryIO]


@dataclass(frozen=True, eq=False)
class _Decoded:
    """Samples of consecutive blocks: start (b,) s of the device's clock, count (b,), acc and gyr (n, 3)."""

    start_s: Floats
    count: NDArray[np.int64]
    acc: Floats
    gyr: Floats | None


def looks_like(data: bytes) -> bool:
    """Whether the first bytes are those of a CWA file."""
    return data[:4] == MAGIC


def open_long(source: str, opener: Opener) -> LongStream:
    """Open a CWA file as a sensor whose samples are read on iteration.

    Raises
    ------
    FormatError : `empty` without a complete block, `bad_cwa` if blocks of different kinds are mixed.
    """
    with opener() as file:
        header = file.read(HEADER)
        first = _first_block(file)
        last_s = _find_last(file)
    if first is None or not looks_like(header):
        raise FormatError("empty", f"{source} holds no samples; copy it from the device again.")
    rate = _rate(int(first["rate"][0]), int(first["offset"][0]))
    start_s = float(_starts(first)[0])
    device = int.from_bytes(header[5:7], "little") | (
        int.from_bytes(header[11:13], "little") << 16 if header[11:13] != b"\xff\xff" else 0
    )
    return LongStream(
        device_id=f"AX-{device}",
        source=source,
        rate_hz=rate,
        has_gyro=int(first["axes"][0]) >> 4 == 6,
        duration_s=max(0.0, last_s - start_s),
        open_blocks=lambda: _read_blocks(source, opener, start_s),
        started_at=dt.datetime(1970, 1, 1) + dt.timedelta(seconds=start_s),  # noqa: DTZ001 - its own clock
    )


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> tuple[Draft, ...]:
    """Read a short CWA file as a whole, like any other reader; raises as `open_long`."""
    stream = open_long(source, lambda: BytesIO(data))
    most = _count_most(data)
    ticks, acc = np.empty(most), np.empty((most, 3))
    gyr = np.empty((most, 3)) if stream.has_gyro else None
    n = 0
    for block in stream.open_blocks():
        rows = slice(n, n := n + len(block.t_s))
        ticks[rows], acc[rows] = block.t_s, block.acc
        if gyr is not None:
            gyr[rows] = block.gyr
    if not n:
        raise FormatError("empty", f"{source} holds no whole block; copy it from the device again.")
    notices: tuple[Notice, ...] = ()
    if gyr is None:
        notices = (
            Notice(
                "missing_gyro",
                f"{source} has no gyroscope: it serves the monitor of daily life alone.",
                stream.device_id,
            ),
        )
    draft = Draft(
        device_id=stream.device_id,
        source=source,
        clock="device",
        ticks=ticks[:n],
        acc=acc[:n],
        gyr=None if gyr is None else gyr[:n],
        mag=None,
        quat=None,
        rate_hz=stream.rate_hz,
        notices=notices,
    )
    return (draft,)


def _count_most(data: bytes) -> int:
    """Upper limit of the number of samples in all blocks, damaged ones included."""
    blocks = max(0, len(data) - HEADER) // BLOCK
    count = np.frombuffer(data, _BLOCK, blocks, min(HEADER, len(data)))["count"]
    return int(np.minimum(count, MOST_SAMPLES).sum())


def _rate(code: int, offset: int) -> float:
    """Samples per second from the code of a block; old files without one have it in the offset."""
    return float(offset) if code == 0 else 3200.0 / (1 << (15 - (code & 15)))


def _first_block(file: BinaryIO) -> NDArray[Any] | None:
    """Header (1,) of the first complete block, None without one."""
    while len(data := file.read(BLOCK * AT_ONCE)) >= BLOCK:
        heads, _ = _whole_blocks(data)
        if len(heads):
            return heads[:1]
    return None


def _find_last(file: BinaryIO) -> float:
    """Start of the last complete block, s of the device's clock."""
    size = file.seek(0, 2)
    blocks = max(0, (size - HEADER) // BLOCK)
    file.seek(max(HEADER, HEADER + (blocks - TAIL) * BLOCK))
    heads, _ = _whole_blocks(file.read())
    return float(_starts(heads[-1:])[0]) if len(heads) else 0.0


def _whole_blocks(data: bytes) -> tuple[NDArray[Any], NDArray[np.uint8]]:
    """Headers and bytes (b, 512) of the intact blocks."""
    count = len(data) // BLOCK
    raw = np.frombuffer(data, np.uint8, count * BLOCK).reshape(count, BLOCK)
    heads = np.frombuffer(data, _BLOCK, count)
    words = np.frombuffer(data, "<u2", count * BLOCK // 2).reshape(count, BLOCK // 2)
    whole = (words.sum(axis=1, dtype=np.uint32) % _SUMMED == 0) | (heads["rate"] == 0)
    whole &= (heads["kind"] == _KIND) & (heads["length"] == _LENGTH) & (heads["clock"] > 0)
    return heads[whole], raw[whole]


def _starts(heads: NDArray[Any]) -> Floats:
    """Time of the first sample of every block (b,), s since 1970 of the device's clock."""
    clock = heads["clock"].astype(np.int64)
    months = ((clock >> 26) + 30) * 12 + ((clock >> 22) & 15) - 1
    days = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) + ((clock >> 17) & 31) - 1
    seconds = days * 86400 + ((clock >> 12) & 31) * 3600 + ((clock >> 6) & 63) * 60 + (clock & 63)
    code = heads["rate"].astype(np.int64)
    rate = np.where(code == 0, np.maximum(heads["offset"], 1), 3200.0 / 2.0 ** (15 - (code & 15)))
    fine = (heads["fraction"] & 0x8000) != 0
    fraction = np.where(fine, (heads["fraction"] & 0x7FFF) / 32768.0, 0.0)
    # the offset was shortened by the fraction in whole samples; both together name one moment
    offset = np.where(code == 0, 0.0, heads["offset"] + np.floor(fraction * rate))
    return np.asarray(seconds + fraction - offset / rate)


def _read_blocks(source: str, opener: Opener, origin_s: float) -> Iterator[SampleBlock]:
    """Samples from the start; damaged blocks are gaps."""
    with opener() as file:
        file.seek(HEADER)
        held = b""  # the last whole block: how long it lasts shows the one behind it
        while len(data := file.read(BLOCK * AT_ONCE)) >= BLOCK:
            heads, raw = _whole_blocks(held + data)
            if len(heads) == bool(held):
                continue
            rate = _rate(int(heads[0]["rate"]), int(heads[0]["offset"]))
            yield _time(_decode(heads, raw, source), len(heads) - 1, rate, origin_s)
            held = raw[-1].tobytes()
        if held:
            yield _time(_decode(*_whole_blocks(held), source), 1, rate, origin_s)


def _decode(heads: NDArray[Any], raw: NDArray[np.uint8], source: str) -> _Decoded:
    """Samples of complete blocks of one kind."""
    if any((heads[name] != heads[name][0]).any() for name in ("axes", "rate")):
        raise FormatError(
            "bad_cwa",
            f"{source} changes its rate or its sensors in the middle; split it with the maker's program.",
        )
    axes, packing = divmod(int(heads["axes"][0]), 16)
    count = heads["count"].astype(np.int64)
    room = 480 // 4 if packing == 0 else 480 // (2 * axes)
    if axes not in (3, 6) or packing not in (0, 2) or count.max() > room:
        raise FormatError(
            "bad_cwa", f"{source} has blocks of {axes} axes in packing {packing}; expected 3 or 6 axes."
        )
    valid = None if count.min() == room else np.arange(room) < count[:, None]
    body = np.ascontiguousarray(raw[:, _DATA : _DATA + 480])
    gyr = None
    light = heads["light"].astype(np.int64)
    if packing == 0:
        acc = np.asarray(_select(_unpack(body.view("<u4")), valid) * (GRAVITY / 256.0))
    else:
        values = body.view("<i2").reshape(len(heads), room, axes)
        per_g = 2.0 ** (8 + (light >> 13))
        acc = np.asarray(_select(values[:, :, -3:], valid) * np.repeat(GRAVITY / per_g, count)[:, None])
        if axes == 6:
            full_dps = 8000.0 / 2.0 ** ((light >> 10) & 7)
            scale = np.repeat(np.radians(full_dps) / 32768.0, count)[:, None]
            gyr = np.asarray(_select(values[:, :, :3], valid) * scale)
    return _Decoded(_starts(heads), count, acc, gyr)


def _select(values: NDArray[Any], valid: NDArray[np.bool_] | None) -> NDArray[Any]:
    """Existing samples (n, 3) of blocks (b, room, 3); None = all of them."""
    return values.reshape(-1, 3) if valid is None else values[valid]


def _unpack(words: NDArray[np.uint32]) -> NDArray[np.int32]:
    """x, y, z (b, n, 3) of 32-bit words (b, n): three signed numbers of 10 bits and a common exponent."""
    signed = words.view(np.int32)
    exponent = (words >> 30).astype(np.int32)
    out = np.empty((*words.shape, 3), np.int32)
    for i in range(3):
        np.left_shift((signed << (22 - 10 * i)) >> 22, exponent, out=out[..., i])
    return out


def _time(blocks: _Decoded, number: int, rate: float, origin_s: float) -> SampleBlock:
    """The samples of the first `number` blocks with their times: evenly spaced between two clock readings."""
    count = blocks.count[:number]
    nominal = count / rate
    lasts = nominal.copy()
    upto = min(number, len(blocks.start_s) - 1)
    measured = np.diff(blocks.start_s)[:upto]
    follows = (measured > 0.0) & (measured < GAP * nominal[:upto])
    lasts[:upto] = np.where(follows, measured, nominal[:upto])
    n = int(count.sum())
    start = blocks.start_s[:number] - origin_s
    if n and count.min() == count.max():
        fraction = np.arange(count[0]) / count[0]
        t_s = (start[:, None] + fraction * lasts[:, None]).ravel()
    else:
        first = np.cumsum(count) - count
        fraction = (np.arange(n) - np.repeat(first, count)) / np.repeat(np.maximum(count, 1), count)
        t_s = np.repeat(start, count) + fraction * np.repeat(lasts, count)
    return SampleBlock(t_s, blocks.acc[:n], None if blocks.gyr is None else blocks.gyr[:n])
