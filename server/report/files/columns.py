"""Low-level reading and writing of result files: Parquet columns over time, JSON and CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import islice
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from sagittal.core.frames import Bools, Floats
from sagittal.core.signals.memory import give_memory_back

if TYPE_CHECKING:
    from sagittal.core.events.turns import Turn  # imports numba, which the web process avoids

SCHEMA = 1
"""Version of analysis.json and its columns; readers reject newer ones."""

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
"""Initial characters that make a spreadsheet interpret a text as a formula."""


PLAIN: Final = frozenset({str, int, bool, type(None)})


def reduce_to_plain(value: object) -> object:
    """Convert records, mappings, sequences and numpy values to JSON types; non-finite numbers become null.

    A record (dataclass) becomes an object with its fields in order.
    """
    kind = type(value)
    if kind is float:
        return value if math.isfinite(value) else None  # type: ignore[arg-type]
    if kind in PLAIN:
        return value
    if isinstance(value, Mapping):
        return {str(k): reduce_to_plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return reduce_to_plain(value.tolist())
    if isinstance(value, (list, tuple, set, frozenset)):
        return [reduce_to_plain(v) for v in value]
    if is_dataclass(value):
        return {f.name: reduce_to_plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.generic):
        return reduce_to_plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (str, int)) else str(value)


def list_turns(turns: Iterable[Turn]) -> list[dict[str, object]]:
    """Turns as in analysis.json and activity.json: s, degrees, degrees/s."""
    return [
        {
            "start_s": t.start_s,
            "end_s": t.end_s,
            "turn_angle_deg": math.degrees(t.angle_rad),
            "turn_duration_s": t.duration_s,
            "turn_peak_velocity_dps": math.degrees(t.peak_rad_s),
            "turn_direction": t.direction,
        }
        for t in turns
    ]


def repeat_words(words: Sequence[str], times: int) -> pa.Array[Any]:
    """A dictionary-encoded column with each word repeated a given number of times."""
    distinct = list(dict.fromkeys(words))
    places = np.repeat(np.array([distinct.index(word) for word in words], np.int16), times)
    return pa.DictionaryArray.from_arrays(places, pa.array(distinct, pa.string()))


ParquetColumn: TypeAlias = "np.ndarray | pa.Array[Any] | Callable[[slice], np.ndarray]"
"""Values of all rows, or a function that returns those of some rows when they are written."""

GROUP: Final = 1 << 17
"""Rows per row group."""


def parquet_file(
    t_s: Floats,
    columns: Mapping[str, ParquetColumn],
    meta: Mapping[str, object],
    written: Callable[[], None] = lambda: None,
) -> bytes:
    """Write columns over time as Parquet with `meta` as JSON under "sagittal"; NaN becomes null.

    Parameters
    ----------
    written : called after each row group.
    """
    metadata = {"sagittal": json.dumps(reduce_to_plain(meta))}
    sink, writer = io.BytesIO(), None
    for first in range(0, max(1, len(t_s)), GROUP):
        table = _lay_out(t_s, columns, slice(first, first + GROUP)).replace_schema_metadata(metadata)
        if writer is None:
            # adjacent samples share their high bytes: byte splitting halves the file
            split = [f.name for f in table.schema if pa.types.is_floating(f.type)]
            writer = pq.ParquetWriter(
                sink, table.schema, compression="zstd", use_dictionary=False, use_byte_stream_split=split
            )
        writer.write_table(table)
        del table
        written()
        if first + GROUP < len(t_s):
            give_memory_back()
    if writer is not None:
        writer.close()
    return sink.getvalue()


def single_precision(values: Floats, column: int) -> Callable[[slice], np.ndarray]:
    """A float32 column of (n, k) for `parquet_file`."""
    return lambda rows: values[rows, column].astype(np.float32)


def _lay_out(t_s: Floats, columns: Mapping[str, ParquetColumn], rows: slice) -> pa.Table:
    arrays: dict[str, pa.Array[Any]] = {"t_s": pa.array(t_s[rows])}
    for name, column in columns.items():
        part = column(rows) if callable(column) else column[rows]
        arrays[name] = part if isinstance(part, pa.Array) else _as_arrow(part)
    return pa.table(arrays)


def _as_arrow(part: np.ndarray) -> pa.Array[Any]:
    """Convert a column; NaN is detected here, as Arrow is twenty times slower if there is none."""
    is_whole = part.dtype.kind == "f" and not np.isnan(part).any()
    column: pa.Array[Any] = pa.array(part, from_pandas=not is_whole)
    return column


def read_table(data: bytes) -> tuple[pa.Table, dict[str, Any]]:
    """Read a Parquet file of ours with the metadata written by `parquet_file`."""
    # our files are small: threads cost more than they save, and `pq.read_table` imports all of
    # pyarrow.dataset
    table = pq.ParquetFile(pa.BufferReader(data)).read(use_threads=False)
    meta: dict[str, Any] = json.loads((table.schema.metadata or {})[b"sagittal"])
    return table, meta


def floats_of(table: pa.Table, name: str) -> Floats:
    """A column as float64; null becomes NaN."""
    column = table.column(name).to_numpy(zero_copy_only=False)
    return np.asarray(column, dtype=np.float64)


def bools_of(table: pa.Table, name: str) -> Bools:
    """A column of booleans."""
    return np.asarray(table.column(name).to_numpy(zero_copy_only=False), dtype=np.bool_)


def write_csv(header: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """UTF-8 CSV with a header; None and non-finite numbers are empty, others rounded to 1e-6.

    Text that a spreadsheet could interpret as a formula is prefixed with an apostrophe (OWASP, "CSV
    injection").
    """
    text, remaining = io.StringIO(), iter(rows)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    while some := list(islice(remaining, LINES)):
        # column by column: most are numbers, which are rounded together
        columns = [_cells(column) for column in zip(*some, strict=True)]
        writer.writerows(zip(*columns, strict=True))
    return text.getvalue().encode()


LINES: Final = 1024
"""Rows of a table written at a time."""

WORDS: Final = frozenset({str, type(None)})

NUMBERS: Final = frozenset({float, type(None), np.float64})

UNSURE: Final = 1e-3
"""Numbers this close to half a millionth, in millionths, are rounded as text: their product is off
by 1e-4.
"""

LARGE: Final = 1e6
"""From here on all numbers are."""


def _cells(column: Sequence[object]) -> list[object]:
    """Format the cells of a column; numbers are rounded like Python's `round`."""
    kinds = set(map(type, column))
    if kinds <= WORDS:
        written = {word: _cell(word) for word in set(column)}
        return [written[word] for word in column]
    if not kinds <= NUMBERS:
        return [_cell(value) for value in column]
    values = np.array(column, np.float64)
    small = np.abs(values) < LARGE
    millionths = 1e6 * np.where(small, values, 0.0)
    whole = np.rint(millionths)
    cells: list[object] = (whole / 1e6 + 0.0).tolist()
    for k in np.flatnonzero(~small | (np.abs(np.abs(millionths - whole) - 0.5) < UNSURE)).tolist():
        value = column[k]
        cells[k] = "" if value is None else _cell(value)
    return cells


def _cell(value: object) -> object:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return round(value, 6) + 0.0 if math.isfinite(value) else ""
    if isinstance(value, str) and value.startswith(FORMULA_STARTS):
        return f"'{value}"
    return "" if value is None else value


def write_json(value: object) -> bytes:
    """Equivalent of `json.dumps` with an indent of 1, using its faster compiled part where possible.

    Raises
    ------
    ValueError
        a number is not finite, or a key is not a string.
    """
    return _write_node(value, "\n").encode()


def _write_node(value: object, line: str) -> str:
    """Format a value as JSON; `line` is a line break with the indentation of the value."""
    inner = f"{line} "
    if not value or not isinstance(value, (dict, list, tuple)):
        return _encoder(inner).encode(value)
    parts = value.values() if isinstance(value, dict) else value
    if PLAIN_NUMBERS.issuperset(map(type, parts)):
        flat = _encoder(inner).encode(value)
        return f"{flat[0]}{inner}{flat[1:-1]}{line}{flat[-1]}"
    if isinstance(value, dict):
        if not all(isinstance(k, str) for k in value):
            raise ValueError("A key is no text: JSON knows no other.")
        nodes = [f"{_encoder(inner).encode(k)}: {_write_node(v, inner)}" for k, v in value.items()]
        return f"{{{inner}{f',{inner}'.join(nodes)}{line}}}"
    return f"[{inner}{f',{inner}'.join([_write_node(v, inner) for v in value])}{line}]"


PLAIN_NUMBERS: Final = PLAIN | {float}


@cache
def _encoder(line: str) -> json.JSONEncoder:
    """Encoder for a list or mapping of plain values, separated by `line`."""
    return json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(f",{line}", ": "))
