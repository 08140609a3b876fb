"""Axivity files made in memory, whose samples are known, and the maker's own."""

from __future__ import annotations

import datetime as dt
import io
import struct
from pathlib import Path

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.formats.vendors import cwa
from sagittal.core.frames import GRAVITY
from tests.data import data_folder

START = dt.datetime(2026, 3, 4, 22, 30)  # noqa: DTZ001 - the device's own clock
RATE = 100.0
CODE = 74
"""±8 g at 100 Hz."""


def clock(seconds: float) -> tuple[int, int]:
    """The device's reading and its fraction."""
    at = START + dt.timedelta(seconds=int(seconds))
    packed = (
        (at.year - 2000) << 26 | at.month << 22 | at.day << 17 | at.hour << 12 | at.minute << 6 | at.second
    )
    return packed, int((seconds % 1.0) * 32768)


def block(first_s: float, counts: np.ndarray, axes: int, packed: bool) -> bytes:
    """A block of whole numbers (n, axes) whose first sample is taken at `first_s`."""
    seconds, fraction = clock(first_s)
    shortened = int(fraction / 32768 * RATE)
    light = 3 << 13 | 2 << 10
    head = struct.pack(
        "<HHHIIIHHBBBBhH", 0x5841, 508, 0x8000 | fraction, 1, 0, seconds, light, 0, 0, 0, CODE,
        axes << 4 | (0 if packed else 2), -shortened, len(counts),
    )  # fmt: skip
    if packed:
        fields = counts & 0x3FF
        body = (fields[:, 0] | fields[:, 1] << 10 | fields[:, 2] << 20).astype("<u4").tobytes()
    else:
        body = counts.astype("<i2").tobytes()
    whole = head + body.ljust(480, b"\0")
    total = int(np.frombuffer(whole, "<u2").sum()) & 0xFFFF
    return whole + struct.pack("<H", (0x10000 - total) & 0xFFFF)


def file(blocks: list[bytes]) -> bytes:
    header = bytearray(b"\xff" * 1024)
    header[:7] = struct.pack("<4sBH", cwa.MAGIC, 0, 4711)
    return bytes(header) + b"".join(blocks)


def standing(n: int) -> np.ndarray:
    return np.tile([0, 128, 256], (n, 1))


def read(data: bytes, name: str = "chest.cwa"):  # type: ignore[no-untyped-def]
    return read_recording([SourceFile.of_bytes(name, data)])


def test_packed_samples_come_in_si_units_at_their_times() -> None:
    made = [block(i * 1.2 + 0.25, standing(120), 3, packed=True) for i in range(5)]
    (stream,) = read(file(made)).streams.values()
    assert (stream.device_id, stream.rate_hz, stream.gyr) == ("AX-4711", RATE, None)
    assert stream.acc[0] == pytest.approx([0.0, 0.5 * GRAVITY, GRAVITY])
    assert np.diff(stream.t_s) == pytest.approx(0.01, abs=1e-3)
    assert len(stream.t_s) == 600


def test_the_exponent_of_packed_samples_and_their_signs_count() -> None:
    words = np.array([[(-4 & 0x3FF) | (3 & 0x3FF) << 10 | (-1 & 0x3FF) << 20 | 2 << 30]], np.uint32)
    assert cwa._unpack(words).tolist() == [[[-16, 12, -4]]]


def test_a_gyroscope_comes_before_the_acceleration() -> None:
    counts = np.tile([3277, 0, 0, 0, 0, 2048], (40, 1))
    recording = read(file([block(i * 0.4, counts, 6, packed=False) for i in range(4)]))
    (stream,) = recording.streams.values()
    assert stream.gyr is not None
    assert np.degrees(stream.gyr[0, 0]) == pytest.approx(200.0, rel=1e-3)
    assert stream.acc[0, 2] == pytest.approx(GRAVITY)
    assert recording.long[stream.device_id].has_gyro


def test_the_long_way_tells_the_clock_and_gives_the_same_samples() -> None:
    recording = read(file([block(i * 1.2, standing(120), 3, packed=True) for i in range(5)]))
    (long,), (stream,) = recording.long.values(), recording.streams.values()
    assert long.started_at == START
    assert np.concatenate([b.t_s for b in long.open_blocks()]) == pytest.approx(stream.t_s)


@pytest.mark.parametrize("at_once", [1, 3, 1024])
def test_how_many_blocks_are_read_together_changes_no_bit(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = file([block(i * 1.207, standing(120) + i, 3, packed=True) for i in range(9)])

    def samples() -> tuple[bytes, bytes]:
        blocks = list(cwa.open_long("a", lambda: io.BytesIO(data)).open_blocks())
        return tuple(np.concatenate([getattr(b, n) for b in blocks]).tobytes() for n in ("t_s", "acc"))  # type: ignore[return-value]

    whole = samples()
    monkeypatch.setattr(cwa, "AT_ONCE", at_once)
    assert samples() == whole


def test_a_damaged_block_is_a_hole() -> None:
    blocks = [block(i * 1.2, standing(120), 3, packed=True) for i in range(5)]
    blocks[2] = blocks[2][:100] + b"\x55" + blocks[2][101:]
    (stream,) = read(file(blocks)).streams.values()
    assert len(stream.t_s) == 480
    assert np.diff(stream.t_s).max() == pytest.approx(1.21, abs=0.02)


def test_a_file_without_samples_is_refused() -> None:
    with pytest.raises(FormatError, match="holds no samples") as error:
        read(file([]))
    assert error.value.code == "empty"


def test_two_kinds_of_blocks_in_one_file_are_refused() -> None:
    mixed = [block(0.0, standing(120), 3, packed=True), block(1.2, standing(80), 3, packed=False)]
    with pytest.raises(FormatError, match="changes its rate") as error:
        cwa.read(file(mixed), "chest.cwa")
    assert error.value.code == "bad_cwa"


@pytest.mark.recorded
@pytest.mark.parametrize(
    ("name", "rate", "gyro"), [("ax3_sample.cwa", 200.0, False), ("ax6_sample.cwa", 100.0, True)]
)
def test_the_makers_files_are_read(name: str, rate: float, gyro: bool) -> None:
    path: Path = data_folder("formats", "axivity") / name
    recording = read_recording([SourceFile.of_path(path)])
    (stream,) = recording.streams.values()
    assert (stream.rate_hz, stream.gyr is not None) == (rate, gyro)
    assert np.median(np.linalg.norm(stream.acc, axis=1)) == pytest.approx(GRAVITY, rel=0.06)
    # both devices run 1.5 % off their nominal rate, evenly
    assert np.diff(stream.t_s).std() < 1e-4
