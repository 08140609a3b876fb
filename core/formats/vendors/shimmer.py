"""Shimmer: CSV written by Consensys (docs/reference/formats.md, "Shimmer Consensys").

A line "sep=,", a line of names like Shimmer_952D_Accel_LN_X_CAL, a line of units, then rows that end with a
separator. Time in ms; of the two accelerometers the low-noise one is used while it stays within its ±2 g.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats import text
from sagittal.core.formats.aliases import segment_in
from sagittal.core.formats.draft import Draft, make_draft
from sagittal.core.formats.source_spec import ACC_UNITS, GYR_UNITS, TIME_UNITS, SourceSpec
from sagittal.core.formats.tables.layout import first_rows, has_decimal_comma
from sagittal.core.frames import GRAVITY, Floats

LABEL: Final = "Shimmer Consensys CSV"
_HEAD: Final = 5
_NAME: Final = re.compile(
    r"(?P<device>.+?)_(?P<what>Timestamp(?:_\w+?)?|Accel_LN_[XYZ]|Accel_WR_[XYZ]|Gyro_[XYZ]|Mag_[XYZ])_(?P<kind>CAL|RAW|UNCAL)"
)
_UNITS: Final = {
    "m/(s^2)": "m/s2",
    "m/s^2": "m/s2",
    "m/s2": "m/s2",
    "g": "g",
    "deg/s": "deg/s",
    "rad/s": "rad/s",
}
_LOW_NOISE_FULL: Final = 1.98 * GRAVITY
"""m/s²: the low-noise accelerometer ends at ±2 g."""


def looks_like(data: bytes) -> bool:
    """Whether the column names are those of a Consensys export."""
    return any(_parse(text.split(line, _separator(data))) for line in text.head_lines(data[:65536], _HEAD))


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> tuple[Draft, ...]:
    """Read every sensor of a file.

    Raises
    ------
    FormatError `missing_acc`, `unknown_unit`, `no_time`, `empty`, `bad_table`, `ambiguous_column`.
    """
    separator = _separator(data)
    lines = text.head_lines(data, _HEAD)
    header_row = next(i for i, line in enumerate(lines) if _parse(text.split(line, separator)))
    names, units = (
        text.split(lines[header_row], separator),
        text.split(lines[header_row + 1], separator) if header_row + 1 < len(lines) else [],
    )
    body = text.after_lines(data, header_row + 2)
    columns = text.fit_names(names, body, separator)
    column_units = dict(zip(columns, units, strict=False))
    devices = _parse(columns)
    selection = [c for group in devices.values() for c in group.values()]
    table = text.read_columns(
        body,
        source,
        separator,
        columns,
        selection,
        decimal_comma=has_decimal_comma(first_rows(body), separator),
    )
    return tuple(
        _sensor(device, group, column_units, table, source, spec) for device, group in devices.items()
    )


def _separator(data: bytes) -> bytes:
    """Separator named in the first line, "sep=,", else a tab if it contains one, else a comma."""
    first = data[:4096].split(b"\n", 1)[0]
    return text.read_separator(first) or (b"\t" if b"\t" in first else b",")


def _parse(names: Sequence[str]) -> dict[str, dict[str, str]]:
    """Device → quantity ("Gyro_X") → column name, calibrated columns only."""
    out: dict[str, dict[str, str]] = {}
    for name in names:
        match = _NAME.fullmatch(name)
        if match is not None and match["kind"] == "CAL":
            quantity = "Timestamp" if match["what"].startswith("Timestamp") else match["what"]
            out.setdefault(match["device"], {}).setdefault(quantity, name)
        elif match is not None:
            out.setdefault(match["device"], {})
    return out


def _sensor(
    device: str,
    group: Mapping[str, str],
    column_units: Mapping[str, str],
    table: text.Columns,
    source: str,
    spec: SourceSpec | None,
) -> Draft:
    def signal(kind: str, units: Mapping[str, float] | None, declared: str | None = None) -> Floats | None:
        columns = [group[name] for axis in "XYZ" if (name := f"{kind}_{axis}") in group]
        if len(columns) < 3:
            return None
        if units is None:
            return table.stack(columns)
        unit = declared or _UNITS.get(column_units.get(columns[0], ""), "")
        if unit not in units:
            raise FormatError(
                "unknown_unit",
                f"{source}: '{columns[0]}' is in '{column_units.get(columns[0], '')}', expected "
                f"{' or '.join(units)}; export calibrated data.",
                sensor=device,
            )
        return table.stack(columns) * units[unit]

    acc_unit, gyr_unit = (spec.acc_unit, spec.gyr_unit) if spec else (None, None)
    fine, wide = signal("Accel_LN", ACC_UNITS, acc_unit), signal("Accel_WR", ACC_UNITS, acc_unit)
    acc, notices = _choose(fine, wide, source)
    if acc is None:
        raise FormatError(
            "missing_acc",
            f"{source}: {device} has no calibrated acceleration; export calibrated data from Consensys.",
            sensor=device,
        )
    if "Timestamp" not in group:
        raise FormatError(
            "no_time", f"{source}: {device} has no calibrated time stamp; export it too.", sensor=device
        )
    clock = column_units.get(group["Timestamp"], "").lower() or "ms"
    if clock not in TIME_UNITS:
        raise FormatError(
            "unknown_unit",
            f"{source}: the time of {device} is in '{clock}', expected one of {', '.join(TIME_UNITS)}; "
            "export it in milliseconds.",
            sensor=device,
        )
    return make_draft(
        device,
        source,
        "device",
        table.values[group["Timestamp"]] * TIME_UNITS[clock],
        acc=acc,
        gyr=signal("Gyro", GYR_UNITS, gyr_unit),
        mag=signal("Mag", None),
        rate_hz=spec.rate_hz if spec else None,
        notices=[*table.notices, *notices],
        segment=segment_in(device),
    )


def _choose(fine: Floats | None, wide: Floats | None, source: str) -> tuple[Floats | None, list[Notice]]:
    """The low-noise accelerometer, replaced by the wide-range one where it saturates."""
    if fine is None or wide is None:
        return (wide if fine is None else fine), []
    if not np.isfinite(fine).any() or (np.abs(fine) > _LOW_NOISE_FULL).any():
        message = f"{source}: the low-noise accelerometer reaches its end, so the wide-range one was read."
        return wide, [Notice("wide_range_read", message, severity="info")]
    return fine, []
