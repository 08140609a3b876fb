"""The workbook, opened as a spreadsheet opens it."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import openpyxl
import pytest
from defusedxml.ElementTree import fromstring

from sagittal.server.export.workbook import WIDEST, write_workbook
from tests.server.export.opened import open_walk
from tests.server.export.test_sheets import left_out, tables

NAMES = ["About", "Parameters", "Strides", "Curves", "Contacts", "Notices", "Dictionary"]


def sheet(book: Any, name: str) -> list[dict[str, Any]]:
    header, *rows = book[name].iter_rows(values_only=True)
    return [dict(zip(header, row, strict=True)) for row in rows]


def test_text_stays_text_and_every_sheet_has_a_frozen_header_and_no_endless_column() -> None:
    book = zipfile.ZipFile(io.BytesIO(write_workbook(open_walk())))
    assert "=HYPERLINK(1)" in book.read("xl/sharedStrings.xml").decode()
    for number in range(1, len(NAMES) + 1):
        text = book.read(f"xl/worksheets/sheet{number}.xml").decode()
        assert "<f>" not in text
        assert 'state="frozen"' in text
        widths = [float(e.get("width") or 0) for e in fromstring(text).iter() if e.tag.endswith("}col")]
        assert 0 < max(widths) < WIDEST + 1
    assert "1980-01-01T00:00:00Z" in book.read("docProps/core.xml").decode()


@pytest.mark.slow
def test_nothing_that_a_person_typed_becomes_a_formula() -> None:
    _, content = left_out()
    assert {r["what"]: r["value"] for r in tables(content)["about.csv"]}["code"] == "'=HYPERLINK(1)"
    book = openpyxl.load_workbook(io.BytesIO(write_workbook(content)))
    cells = [c for s in book for row in s.iter_rows() for c in row if c.value is not None]
    assert {c.data_type for c in cells} == {"s", "n"}
    assert any(c.value == "=HYPERLINK(1)" for c in cells)


@pytest.mark.slow
def test_the_workbook_holds_the_numbers_of_the_analysis() -> None:
    content = open_walk()
    data = write_workbook(content)
    assert data == write_workbook(open_walk())
    book = openpyxl.load_workbook(io.BytesIO(data))
    assert book.sheetnames == NAMES
    named = {(r["parameter"], r["side"]): r["mean"] for r in sheet(book, "Parameters")}
    assert named == {
        (p.name, p.side): None if p.mean is None else pytest.approx(p.mean) for p in content.bundle.parameters
    }
    assert [r["cycle"] for r in sheet(book, "Strides")] == [c.number for c in content.cycles]
    curves = sheet(book, "Curves")
    assert len(curves) == 101
    knee = [row["knee_flexion_left_mean_deg"] for row in curves]
    assert 55.0 < max(knee) < 65.0
