"""BIDS motion (BIDS 1.10, "Motion"): a table without header, with sidecar files that name its columns.

`…_channels.tsv` lists for every column the quantity, the tracked point and the unit; `…_motion.json` the
rate. Both become an entry of `sources` for `…_motion.tsv`, which is then read like any described table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from sagittal.core.errors import FormatError
from sagittal.core.formats import text
from sagittal.core.formats.aliases import segment_named
from sagittal.core.formats.json_tree import read_json
from sagittal.core.formats.source_spec import ACC_UNITS, GYR_UNITS, TIME_UNITS, Channels, SourceSpec
from sagittal.core.frames import Segment

_CHANNELS: Final = "_channels.tsv"
_MOTION: Final = "_motion.tsv"
_SIDECAR: Final = "_motion.json"
_TYPES: Final = {"ACCEL": "acc", "GYRO": "gyr", "MAGN": "mag"}
_AXES: Final = ("x", "y", "z")
_NAMES: Final = {"seconds": "s", "rad/sec": "rad/s", "°/sec": "deg/s", "deg/sec": "deg/s"}
_MOST_COLUMNS: Final = 4096


@dataclass(frozen=True)
class BidsTable:
    """Specification of one table, and the segments of its tracked points according to their name or
    placement.
    """

    spec: SourceSpec
    worn: Mapping[str, Segment | None]


def looks_like(data: bytes) -> bool:
    """Whether a header is that of a channel list."""
    names = text.split(text.head_lines(data[:4096], 1)[0], b"\t") if data.strip() else []
    return {"name", "component", "type", "tracked_point", "units"} <= set(names)


def is_table(name: str) -> bool:
    """Whether a file is the table, by its name, the only criterion in BIDS."""
    return name.lower().endswith(_MOTION)


def find_parts(name: str) -> tuple[str, str]:
    """Names of the channel list and the sidecar of a table."""
    stem = name[: -len(_MOTION)]
    return f"{stem}{_CHANNELS}", f"{stem}{_SIDECAR}"


def describe_table(name: str, head: bytes, channels: bytes, sidecar: bytes | None) -> BidsTable:
    """Specification of the table `name`, which begins with `head`.

    Raises
    ------
    FormatError `missing_acc` (positions or angles alone), `unknown_unit`, `rate_missing`, `bad_table`,
    `ambiguous_column`.
    """
    rows = _rows(channels, name)
    cells = text.first_row(memoryview(head)).count(b"\t") + 1
    if cells != len(rows):
        raise FormatError(
            "bad_table",
            f"{name} has {cells} columns, but its channels.tsv names {len(rows)}; export both again.",
        )
    points, units, time = _sort_channels(rows, name)
    groups = {
        point: {
            kind: tuple(axes[a] for a in _AXES) for kind, axes in kinds.items() if set(axes) == set(_AXES)
        }
        for point, kinds in points.items()
    }
    columns = {point: Channels(**kinds) for point, kinds in groups.items() if "acc" in kinds}
    if not columns:
        types = ", ".join(sorted({row["type"] for row in rows})) or "none"
        raise FormatError(
            "missing_acc", f"{name} holds no acceleration (types: {types}); Sagittal reads inertial sensors."
        )
    placed = {row["tracked_point"]: row.get("placement", "") for row in rows}
    return BidsTable(
        SourceSpec(
            file=name,
            skip_rows=0,
            header_rows=0,
            separator="\t",
            rate_hz=_rate(sidecar, rows, name),
            time_column=time[0] if time else None,
            time_unit=_unit(time[1], TIME_UNITS, name) if time else "s",
            acc_unit=_unit(units["acc"], ACC_UNITS, name),
            gyr_unit=_unit(units["gyr"], GYR_UNITS, name) if "gyr" in units else None,
            columns=columns,
        ),
        {p: s for p in columns if (s := segment_named(p) or segment_named(placed[p])) is not None},
    )


def _sort_channels(
    rows: Sequence[Mapping[str, str]], name: str
) -> tuple[dict[str, dict[str, dict[str, str]]], dict[str, str], tuple[str, str] | None]:
    """Tracked point → signal → axis → column, the unit of every signal, and column and unit of time."""
    points: dict[str, dict[str, dict[str, str]]] = {}
    units: dict[str, str] = {}
    time: tuple[str, str] | None = None
    for i, row in enumerate(rows):
        column = str(i + 1)
        kind = _TYPES.get(row["type"].upper())
        if row["type"].upper() == "LATENCY":
            if time is not None:
                raise _ambiguous(name, "time", time[0], column)
            time = (column, row["units"])
        if kind is None or row["component"].lower() not in _AXES:
            continue
        axes = points.setdefault(row["tracked_point"], {}).setdefault(kind, {})
        previous = axes.setdefault(row["component"].lower(), column)
        if previous != column:
            label = f"{row['type']} {row['component']} of '{row['tracked_point']}'"
            raise _ambiguous(name, label, previous, column)
        if units.setdefault(kind, row["units"]) != row["units"] and kind != "mag":
            raise FormatError(
                "unknown_unit", f"{name}: its channels of type {row['type']} have several units."
            )
    return points, units, time


def _ambiguous(name: str, label: str, first: str, second: str) -> FormatError:
    return FormatError(
        "ambiguous_column",
        f"{name}: expected one column for {label}, but its channels.tsv names columns {first} and {second}. "
        "Give them different tracked points, or export one of them.",
    )


def _rows(channels: bytes, name: str) -> list[dict[str, str]]:
    lines = [line for line in text.head_lines(channels, _MOST_COLUMNS + 2) if line.strip()]
    header = text.split(lines[0], b"\t")
    rows = [dict(zip(header, text.split(line, b"\t"), strict=False)) for line in lines[1:]]
    needed = ("type", "component", "tracked_point", "units")
    if len(rows) > _MOST_COLUMNS or any(key not in row for row in rows for key in needed):
        raise FormatError("bad_table", f"{name}: its channels.tsv has rows without {', '.join(needed)}.")
    return rows


def _unit(unit_text: str, factors: Mapping[str, float], name: str) -> str:
    unit = _NAMES.get(unit_text, unit_text)
    if unit not in factors:
        raise FormatError(
            "unknown_unit",
            f"{name}: its channels are in '{unit_text}', expected one of {', '.join(factors)}.",
        )
    return unit


def _rate(sidecar: bytes | None, rows: Sequence[Mapping[str, str]], name: str) -> float:
    """Effective rate from the sidecar, else its nominal rate, else that of the channels."""
    info: Any = {}
    with suppress(ValueError):
        info = read_json(sidecar or b"{}")
    keys = ("SamplingFrequencyEffective", "SamplingFrequency")
    candidates: list[Any] = [info.get(key) for key in keys] if isinstance(info, dict) else []
    candidates += [row.get("sampling_frequency") for row in rows[:1]]
    for value in candidates:
        try:
            rate = float(value)
        except (TypeError, ValueError):
            continue
        if 1.0 <= rate <= 100_000.0:
            return rate
    raise FormatError(
        "rate_missing", f"{name}: neither motion.json nor channels.tsv names a sampling frequency."
    )
