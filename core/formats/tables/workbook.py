"""Excel workbooks (.xlsx): every sheet with numbers becomes a table of text, which is read like any other.

Dates come as ISO 8601. Needs openpyxl: pip install 'sagittal[xlsx]'.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable
from typing import Any, Final

from sagittal.core.errors import FormatError
from sagittal.core.formats.source import SourceFile

_BOOK: Final = "xl/workbook.xml"
_BINARY: Final = "xl/workbook.bin"
_DAMAGE: Final = (
    zipfile.BadZipFile,
    KeyError,
    ValueError,
    TypeError,
    IndexError,
    AttributeError,
    OSError,
    SyntaxError,
)


def is_workbook(members: Iterable[str]) -> bool:
    """Tell a workbook by the members of its zip."""
    return bool({_BOOK, _BINARY} & set(members))


def read_sheets(name: str, data: bytes) -> list[SourceFile]:
    """Tables of a workbook as tab-separated text, one file for every sheet that holds more than one row.

    Parameters
    ----------
    name : of the workbook; a single sheet keeps it, several are "name/sheet".

    Raises
    ------
    FormatError `reader_missing`, `bad_workbook`.
    """
    try:
        import openpyxl  # an extra, and slow to import
    except ImportError as e:
        raise FormatError(
            "reader_missing",
            f"{name} is an Excel workbook; reading it needs openpyxl (pip install 'sagittal[xlsx]'). "
            "Or save it as CSV.",
        ) from e
    try:
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        sheets = {sheet.title: _as_text(sheet) for sheet in book.worksheets}
    except _DAMAGE as e:
        raise FormatError(
            "bad_workbook", f"{name} is an Excel workbook that cannot be read ({e}); save it as CSV."
        ) from e
    tables = {title: text for title, text in sheets.items() if text.count(b"\n") > 1}
    if len(tables) == 1:
        return [SourceFile.of_bytes(name, next(iter(tables.values())))]
    return [SourceFile.of_bytes(f"{name}/{title}", text) for title, text in tables.items()]


def _as_text(sheet: Any) -> bytes:
    """Rows of a sheet up to the last one with a value."""
    rows = ["\t".join(map(_cell, row)).rstrip("\t") for row in sheet.iter_rows(values_only=True)]
    while rows and not rows[-1]:
        rows.pop()
    widest = max((row.count("\t") for row in rows), default=0)
    return "".join(row + "\t" * (widest - row.count("\t")) + "\n" for row in rows).encode()


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    if hasattr(value, "isoformat"):  # a date, a time of day or both
        return str(value.isoformat()).replace("T", " ")
    if hasattr(value, "total_seconds"):
        return repr(value.total_seconds())
    return " ".join(str(value).split())
