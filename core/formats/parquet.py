"""Sagittal's own recording file: Parquet with one column per channel (docs/reference/formats.md, "Sagittal
recording (Parquet)").

int64 time in µs, float32 signals, zstd with byte-stream split, page checksums and no dictionary; everything
except the signals (units, sensor → segment, subject, protocol, hashes of the originals) is JSON in the schema
metadata. Rows are the union of the times of all streams; a row that a stream does not have is null, a missing
one NaN.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, Final, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats.draft import has_whole_row, signal_digest
from sagittal.core.formats.json_tree import read_json
from sagittal.core.formats.source import SourceFile
from sagittal.core.frames import Floats, Protocol, Segment
from sagittal.core.plurals import plural
from sagittal.core.signals.recording import ImuStream, Recording, Subject
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock
from sagittal.core.subject.anthropometry import BodyMeasures
from sagittal.core.subject.shoe import Shoe

MAGIC: Final = b"PAR1"
SCHEMA: Final = 1
_KEY: Final = b"sagittal.recording"
_TIME: Final = "t_us"
_AXES: Final = {
    "acc": ("acc_x", "acc_y", "acc_z"),
    "gyr": ("gyr_x", "gyr_y", "gyr_z"),
    "mag": ("mag_x", "mag_y", "mag_z"),
    "quat": ("quat_w", "quat_x", "quat_y", "quat_z"),
}
DAMAGE: Final = (
    pa.ArrowException, OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError,
)  # fmt: skip
"""What reading raises of a file that `write_recording` did not write, metadata nested without end too."""
AHEAD: Final = 1 << 16
"""Bytes of each column of a long file that are read at once; without it a million rows are."""

LONG_BLOCK: Final = 1 << 14
"""Rows of a long file that are decoded together."""

LARGE: Final = 1 << 22
"""Bytes from which on NumPy asks the system for large pages."""

_MAX_ROWS: Final = 50_000_000
_MAX_BYTES: Final = 4_000_000_000
"""Declared sizes are checked before anything is allocated."""


def write_recording(recording: Recording) -> bytes:
    """Serialise a recording; equal recordings give equal bytes."""
    times = {d: _micros(s.t_s) for d, s in recording.streams.items()}
    axis = np.unique(np.concatenate(list(times.values())))
    columns: dict[str, pa.Array[Any]] = {_TIME: pa.array(axis)}
    everywhere = {_TIME}
    for device, stream in recording.streams.items():
        rows = np.searchsorted(axis, times[device])
        absent = np.ones(len(axis), np.bool_)
        absent[rows] = False
        holes = bool(absent.any())
        for kind, names in _AXES.items():
            signal: Floats | None = getattr(stream, kind)
            for i, name in enumerate(names if signal is not None else ()):
                assert signal is not None  # noqa: S101 - for mypy, the loop is empty otherwise
                channel = np.zeros(len(axis), np.float32)
                channel[rows] = signal[:, i]
                columns[f"{device}.{name}"] = pa.array(channel, mask=absent if holes else None)
                if not holes:
                    everywhere.add(f"{device}.{name}")
    text = json.dumps(_metadata(recording), ensure_ascii=False, sort_keys=True)
    # a column without holes is declared so: a sixth less work for who reads it
    fields = [pa.field(name, x.type, nullable=name not in everywhere) for name, x in columns.items()]
    table = pa.table(columns, pa.schema(fields, {_KEY: text.encode()}))
    sink = pa.BufferOutputStream()
    signals = [c for c in table.column_names if c != _TIME]
    pq.write_table(
        table,
        sink,
        compression="zstd",
        use_dictionary=False,
        use_byte_stream_split=cast("bool", signals),  # the stubs know only True and False
        row_group_size=1 << 20,
        write_page_checksum=True,
    )
    return bytes(sink.getvalue().to_pybytes())


def _micros(t_s: Floats) -> NDArray[np.int64]:
    return np.round(t_s * 1e6).astype(np.int64)


def _metadata(r: Recording) -> dict[str, object]:
    return {
        "schema": SCHEMA,
        "units": {"t": "us", "acc": "m/s2", "gyr": "rad/s", "quat": "wxyz, sensor to world"},
        "subject": r.subject.to_json(),
        "protocol": r.protocol,
        "belt_speed_mps": r.belt_speed_mps,
        "mounting": dict(r.mounting),
        "sha256": dict(r.sha256),
        "notices": [n.to_json() for n in r.notices],
        "sensors": [
            {
                "id": s.device_id,
                "segment": r.segments.get(s.device_id),
                "mapped": s.device_id in r.segments,
                "source": s.source,
                "rate_hz": s.rate_hz,
                "clock": s.clock,
                "notices": [n.to_json() for n in s.notices],
            }
            for s in r.streams.values()
        ],
    }


def looks_like(data: bytes) -> bool:
    """Whether the data have Parquet's magic at both ends."""
    return data[:4] == MAGIC


def read_recording(data: bytes, source: str) -> Recording:
    """Read a file written by `write_recording`.

    Raises
    ------
    FormatError bad_parquet (damaged or too large), foreign_parquet (not written by Sagittal), newer_schema.
    """
    try:
        file = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True, pre_buffer=False)
        meta = file.metadata
        unpacked = sum(meta.row_group(i).total_byte_size for i in range(meta.num_row_groups))
        if meta.num_rows > _MAX_ROWS or unpacked > _MAX_BYTES:
            raise FormatError(
                "bad_parquet", f"{source} declares {meta.num_rows} rows, {unpacked} bytes: too large."
            )
        info = _read_info((meta.metadata or {}).get(_KEY), source)
        return _recording(file, info, source)
    except DAMAGE as e:
        raise FormatError("bad_parquet", f"{source} is a damaged recording ({e}); upload it again.") from e


def count_rows_and_sensors(file: SourceFile) -> tuple[int, int]:
    """Number of rows and sensors of a Parquet file; 0 if damaged."""
    try:
        with file.open() as opened:
            opened_file = pq.ParquetFile(opened)
            sensors = sum(name.endswith(f".{_AXES['acc'][0]}") for name in opened_file.schema_arrow.names)
            return int(opened_file.metadata.num_rows), sensors
    except DAMAGE:
        return 0, 0


def open_long(file: SourceFile) -> Recording:
    """Open a stored recording too long for memory: its sensors are read block by block.

    Raises
    ------
    FormatError as `read_recording`.
    """
    try:
        with file.open() as opened:
            reader = pq.ParquetFile(opened, pre_buffer=False, buffer_size=AHEAD)
            meta = reader.metadata
            info = _read_info((meta.metadata or {}).get(_KEY), file.name)
            first, _ = _find_ends(reader, 0)
            _, last = _find_ends(reader, meta.num_row_groups - 1)
            column_names = set(reader.schema_arrow.names)
        subject, sensors = _read_subject(info), _list(info["sensors"])
        long = {}
        for sensor in sensors:
            device = str(sensor["id"])
            has_gyro = f"{device}.gyr_x" in column_names
            long[device] = LongStream(
                device_id=device,
                source=str(sensor["source"]),
                rate_hz=float(str(sensor["rate_hz"])),
                has_gyro=has_gyro,
                duration_s=(last - first) * 1e-6,
                open_blocks=partial(_read_blocks, file, device, has_gyro, first),
                notices=tuple(Notice.from_json(n) for n in _list(sensor["notices"])),
            )
        return Recording(
            streams={},
            segments={str(s["id"]): cast("Segment | None", s["segment"]) for s in sensors if s["mapped"]},
            subject=subject,
            protocol=cast("Protocol", info["protocol"]),
            mounting=_texts(info["mounting"]),
            sha256=_texts(info["sha256"]),
            notices=tuple(Notice.from_json(n) for n in _list(info["notices"])),
            long=long,
        )
    except DAMAGE as e:
        raise FormatError("bad_parquet", f"{file.name} is a damaged recording ({e}); upload it again.") from e


def _find_ends(reader: pq.ParquetFile, group: int) -> tuple[int, int]:
    """First and last time of a row group, µs."""
    ends: list[int] = []
    for batch in reader.iter_batches(LONG_BLOCK, row_groups=[group], columns=[_TIME], use_threads=False):
        if batch.num_rows:
            ends += [batch[_TIME][0].as_py(), batch[_TIME][-1].as_py()]
    return ends[0], ends[-1]


def _read_blocks(file: SourceFile, device: str, has_gyro: bool, first_us: int) -> Iterator[SampleBlock]:
    """Iterate over the rows of one sensor from the first one."""
    kinds = ("acc", "gyr") if has_gyro else ("acc",)
    names = [f"{device}.{name}" for kind in kinds for name in _AXES[kind]]
    with file.open() as opened:
        reader = pq.ParquetFile(opened, page_checksum_verification=True, pre_buffer=False, buffer_size=AHEAD)
        for batch in reader.iter_batches(LONG_BLOCK, columns=[_TIME, *names], use_threads=False):
            columns = [batch[name].to_numpy(zero_copy_only=False) for name in names]
            values = np.stack(columns, axis=-1, dtype=np.float64)
            values[~np.isfinite(values)] = np.nan
            t_s = (batch[_TIME].to_numpy() - first_us) * 1e-6
            yield SampleBlock(t_s, values[:, :3], values[:, 3:] if has_gyro else None)


def _read_info(stored: bytes | None, source: str) -> dict[str, object]:
    """Metadata of a stored recording; raises FormatError `foreign_parquet`, `newer_schema`."""
    if stored is None:
        raise FormatError(
            "foreign_parquet",
            f"{source} is a Parquet file that Sagittal did not write; export the recording as CSV and "
            "describe it in a manifest (docs/reference/formats.md).",
        )
    info: Any = read_json(stored)
    if info["schema"] > SCHEMA:
        raise FormatError(
            "newer_schema",
            f"{source} was written by a newer Sagittal (schema {info['schema']}); update this one.",
        )
    return cast("dict[str, object]", info)


def _read_subject(info: Mapping[str, object]) -> Subject:
    subject = info["subject"]
    if not isinstance(subject, dict) or not isinstance(info["protocol"], str):
        raise TypeError("metadata")
    return Subject(
        subject["height_m"],
        subject.get("standing_width_m"),
        subject.get("standing_angles_deg") or {},
        None if (shoe := subject.get("shoe")) is None else Shoe(**shoe),
        BodyMeasures(**subject.get("measures") or {}),
    )


def _recording(file: pq.ParquetFile, info: Mapping[str, object], source: str) -> Recording:
    axis = file.read([_TIME], use_threads=False)[_TIME].to_numpy() * 1e-6
    column_names = frozenset(file.schema_arrow.names)
    sensors = _list(info["sensors"])
    rooms = {kind: _make_rooms(len(sensors), len(axis), len(names)) for kind, names in _AXES.items()}
    streams: dict[str, ImuStream] = {}
    segments: dict[str, object] = {}
    notices: list[Notice] = []
    for sensor in sensors:
        device = str(sensor["id"])
        signals, rows = _read_signals(file, device, column_names, rooms)
        acc = signals["acc"]
        sensor_notices = [Notice.from_json(n) for n in _list(sensor["notices"])]
        sensor_notices += _clear_infinite(device, signals)
        if not has_whole_row(acc):
            message = f"{device} in {source} holds no acceleration; results that need it are left out."
            notices.append(Notice("sensor_missing", message, device))
            continue
        if (gyr := signals["gyr"]) is not None and not has_whole_row(gyr):
            signals["gyr"] = None
            message = f"{device} in {source} holds no angular rate; it cannot be used for orientations."
            sensor_notices.append(Notice("missing_gyro", message, device))
        streams[device] = ImuStream(
            device_id=device,
            source=str(sensor["source"]),
            t_s=axis[rows],
            acc=acc,
            gyr=signals["gyr"],
            mag=signals["mag"],
            quat=signals["quat"],
            rate_hz=float(str(sensor["rate_hz"])),
            clock=str(sensor["clock"]),
            digest=signal_digest(acc, signals["gyr"], signals["mag"]),
            notices=tuple(sensor_notices),
        )
        if sensor["mapped"]:
            segments[device] = sensor["segment"]
    if not streams:
        raise FormatError("no_signal", f"No sensor in {source} measured anything; record again.")
    return Recording(
        streams=streams,
        segments=cast("dict[str, Segment | None]", segments),  # Recording checks them
        subject=_read_subject(info),
        protocol=cast("Protocol", info["protocol"]),
        mounting=_texts(info["mounting"]),
        sha256=_texts(info["sha256"]),
        notices=(*(Notice.from_json(n) for n in _list(info["notices"])), *notices),
        belt_speed_mps=None if (belt := info.get("belt_speed_mps")) is None else float(str(belt)),
    )


def _read_signals(
    file: pq.ParquetFile,
    device: str,
    column_names: frozenset[str],
    rooms: Mapping[str, Iterator[NDArray[np.float32]]],
) -> tuple[dict[str, Any], NDArray[np.int64] | slice]:
    """Signals (n, axes) of a sensor as float32, None if not in the file, and the rows it has.

    One signal at a time: reading the whole table would double the memory.
    """
    signals: dict[str, Any] = dict.fromkeys(_AXES)
    rows: NDArray[np.int64] | slice = slice(None)
    for kind, names in _AXES.items():
        columns = [f"{device}.{n}" for n in names]
        if columns[0] not in column_names:
            if kind == "acc":
                raise KeyError(f"{device}.acc")
            continue
        table = file.read(columns, use_threads=False)
        if kind == "acc" and (first := table[columns[0]]).null_count:
            rows = np.flatnonzero(first.is_valid().to_numpy())
        if isinstance(rows, slice):
            signal = next(rooms[kind])
        else:
            signal = np.empty((len(rows), len(names)), np.float32)
        with np.errstate(invalid="ignore"):
            for i, column in enumerate(columns):
                np.copyto(signal[:, i], table[column].to_numpy()[rows])
        signals[kind] = signal
    return signals, rows


def _make_rooms(sensors: int, rows: int, axes: int) -> Iterator[NDArray[np.float32]]:
    """Arrays (rows, axes) to be filled, one per sensor, small ones allocated together.

    First access to fresh memory costs more than the processing, and in one large allocation, for which NumPy
    requests huge pages, a fifth of many small ones.
    """
    together = max(1, -(-LARGE // max(1, rows * axes * 4)))
    while sensors > 0:
        piece = sensors if sensors < 2 * together else together
        yield from np.empty((piece, rows, axes), np.float32)
        sensors -= piece


def _clear_infinite(device: str, signals: Mapping[str, Floats | None]) -> list[Notice]:
    """Replace infinite values by missing ones, in place; returns a notice if there were any."""
    count = 0
    for kind in ("acc", "gyr", "mag"):
        signal = signals[kind]
        if signal is not None:
            wrong = np.isinf(signal)
            if wrong.any():
                count += int(np.count_nonzero(wrong.any(axis=1)))
                signal[wrong] = np.nan
    message = plural(
        count,
        f"{count} sample of {device} is infinite and counts as lost.",
        f"{count} samples of {device} are infinite and count as lost.",
    )
    return [Notice("not_finite", message, device)] if count else []


def _texts(value: object) -> dict[str, str]:
    if not isinstance(value, dict) or not all(isinstance(x, str) for x in value.values()):
        raise TypeError("metadata: expected texts")
    return value


def _list(value: object) -> list[dict[str, object]]:
    if not isinstance(value, list):
        raise TypeError("metadata: expected a list")
    return value
