"""Xsens and Movella DOT: CSV of the DOT app and its SDK (docs/reference/formats.md, "Movella DOT").

A line "sep=,", lines "key:,value", a blank line, a header line, then rows: one file per sensor. Acceleration
in m/s² and angular rate in deg/s in the sensor's axes, orientation sensor → earth; the clock counts µs with
32 bit.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats import text
from sagittal.core.formats.aliases import segment_in
from sagittal.core.formats.draft import WRAP_32, Draft, make_draft
from sagittal.core.formats.source import stem_of
from sagittal.core.formats.source_spec import ACC_UNITS, GYR_UNITS, SourceSpec
from sagittal.core.formats.tables.layout import first_rows, has_decimal_comma
from sagittal.core.frames import Floats

LABEL: Final = "Movella DOT CSV"
_HEAD: Final = 40
"""Lines before the header line at most."""
_ACC: Final = ("Acc_X", "Acc_Y", "Acc_Z")
_GYR: Final = ("Gyr_X", "Gyr_Y", "Gyr_Z")
_MAG: Final = ("Mag_X", "Mag_Y", "Mag_Z")
_QUAT: Final = ("Quat_W", "Quat_X", "Quat_Y", "Quat_Z")
_COUNTER: Final = "PacketCounter"
_FINE: Final = "SampleTimeFine"
_MICRO: Final = 1e-6
_RATE: Final = re.compile(r"(\d{1,4}(?:\.\d+)?)\s*Hz", re.IGNORECASE)
_EVERYBODYS: Final = {"", "xsens dot", "movella dot"}
"""Tags as sensors leave the factory: they tell none from another."""


def looks_like(data: bytes) -> bool:
    """Whether the data begin with the key lines of a DOT file."""
    head = data[:4096]
    return b"DeviceTag:" in head and _COUNTER.encode() in head


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> tuple[Draft, ...]:
    """Read one sensor.

    Raises
    ------
    FormatError `empty`, `bad_table`, `ambiguous_column`, `gravity_removed`, `missing_acc`.
    """
    lines = text.head_lines(data, _HEAD)
    separator = text.read_separator(lines[0]) or b","
    header_row, says = _read_keys(lines, separator, source)
    device = _device(says, source)
    names = text.split(lines[header_row], separator)
    if not set(_ACC) <= set(names):
        raise _no_acc(source, device, names, says)
    body = text.after_lines(data, header_row + 1)
    names = text.fit_names(names, body, separator)
    groups = [g for g in (_ACC, _GYR, _MAG, _QUAT) if set(g) <= set(names)]
    selection = [c for c in (_COUNTER, _FINE) if c in names] + [c for g in groups for c in g]
    table = text.read_columns(
        body,
        source,
        separator,
        names,
        selection,
        decimal_comma=has_decimal_comma(first_rows(body), separator),
    )
    rate = spec.rate_hz if spec and spec.rate_hz else _rate(says)
    clock, ticks, wrap, clock_notices = _read_clock(table, says, source)
    return (
        make_draft(
            device,
            source,
            clock,
            ticks,
            acc=table.stack(_ACC) * ACC_UNITS[(spec and spec.acc_unit) or "m/s2"],
            gyr=table.stack(_GYR) * GYR_UNITS[(spec and spec.gyr_unit) or "deg/s"]
            if _GYR in groups
            else None,
            mag=table.stack(_MAG) if _MAG in groups else None,
            quat=table.stack(_QUAT) if _QUAT in groups else None,
            rate_hz=rate,
            notices=[*table.notices, *clock_notices],
            wrap=wrap,
            segment=segment_in(says.get("devicetag", "")),
        ),
    )


def _read_keys(lines: Sequence[bytes], separator: bytes, source: str) -> tuple[int, dict[str, str]]:
    """Index of the header line, and values by key from the lines before it."""
    header_row = next(
        (i for i, line in enumerate(lines) if _COUNTER in text.split(line, separator) and b":" not in line),
        None,
    )
    if header_row is None:
        raise FormatError("bad_table", f"{source} has no header line with {_COUNTER}; export it again.")
    says = {
        cells[0].rstrip(": ").lower(): cells[1]
        for line in lines[:header_row]
        if (cells := text.split(line, separator))[1:]
    }
    return header_row, says


def _read_clock(
    table: text.Columns, says: Mapping[str, str], source: str
) -> tuple[str, Floats, float, tuple[Notice, ...]]:
    """Kind of clock, its ticks, its wrap, and notices."""
    fine = table.values.get(_FINE)
    if fine is None or not np.isfinite(fine).any():
        return "counter", table.values[_COUNTER], float(WRAP_32), ()
    ticks, wrap = fine * _MICRO, WRAP_32 * _MICRO
    if not says.get("syncstatus", "").lower().startswith("un"):
        return "device", ticks, wrap, ()
    return "device", np.mod(ticks - ticks[np.isfinite(ticks)][0], wrap), wrap, (_unsynchronised(source),)


def _device(says: Mapping[str, str], source: str) -> str:
    """The user-assigned tag of the sensor, else the file's name."""
    tag = says.get("devicetag", "")
    return stem_of(source) if tag.lower() in _EVERYBODYS else tag


def _rate(says: Mapping[str, str]) -> float | None:
    match = _RATE.search(says.get("outputrate", ""))
    return float(match[1]) if match and float(match[1]) >= 1.0 else None


def _unsynchronised(source: str) -> Notice:
    return Notice(
        "not_synchronised",
        f"{source} was recorded without synchronisation, so its first sample counts as the start. "
        "Sensors may be seconds apart; synchronise them in the app next time.",
    )


def _no_acc(source: str, device: str, names: list[str], says: Mapping[str, str]) -> FormatError:
    mode = says.get("measurement mode", "")
    todo = "Record in Custom Mode 5 or another mode with acceleration and angular velocity."
    if "FreeAcc_X" in names:
        return FormatError(
            "gravity_removed",
            f"{source} holds acceleration without gravity alone (mode '{mode}'). {todo}",
            sensor=device,
        )
    return FormatError(
        "missing_acc", f"{source} holds no acceleration (mode '{mode}'). {todo}", sensor=device
    )
