"""Excel workbooks."""

from __future__ import annotations

import datetime as dt
import io
import zipfile

import openpyxl
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.archive import expand
from sagittal.core.formats.source import SourceFile
from sagittal.core.formats.tables.workbook import is_workbook, read_sheets


def book(*sheets: list[list[object]]) -> bytes:
    made = openpyxl.Workbook()
    made.remove(made.active)
    for i, rows in enumerate(sheets):
        sheet = made.create_sheet(f"sheet {i}")
        for row in rows:
            sheet.append(row)
    out = io.BytesIO()
    made.save(out)
    return out.getvalue()


ROWS: list[list[object]] = [
    ["t", "x"],
    [0.1, 2],
    [dt.datetime.fromisoformat("2024-02-07 11:27:27.350"), None],
    [0.3, 1e-5],
]


def test_a_sheet_is_a_table_of_text() -> None:
    (sheet,) = expand([SourceFile.of_bytes("walk.xlsx", book(ROWS, []))])
    assert sheet.name == "walk.xlsx"
    assert sheet.read().decode().splitlines() == [
        "t\tx",
        "0.1\t2",
        "2024-02-07 11:27:27.350000\t",
        "0.3\t1e-05",
    ]


def test_several_sheets_and_a_workbook_in_a_zip() -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as packed:
        packed.writestr("in/walk.xlsx", book(ROWS, ROWS))
    names = [f.name for f in expand([SourceFile.of_bytes("all.zip", out.getvalue())])]
    assert names == ["in/walk.xlsx/sheet 0", "in/walk.xlsx/sheet 1"]


def test_a_damaged_workbook_is_refused() -> None:
    assert is_workbook(["xl/workbook.xml"])
    with pytest.raises(FormatError) as e:
        read_sheets("a.xlsx", b"PK\x03\x04 no workbook")
    assert e.value.code == "bad_workbook"
