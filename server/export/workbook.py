"""Excel workbook of an analysis; text is written as strings, so that it is never interpreted as formulas."""

from __future__ import annotations

import datetime as dt
import io
from math import isfinite
from typing import Final

import xlsxwriter

from sagittal.server.export import sheets
from sagittal.server.export.content import ExportContent

MADE: Final = dt.datetime(1980, 1, 1, tzinfo=dt.UTC)
"""Fixed date in the file's properties, so that the same analysis gives the same bytes."""

WIDEST: Final = 60
"""Maximum column width, characters."""


def write_workbook(content: ExportContent) -> bytes:
    """Write one sheet per table, with a frozen header and a filter."""
    target = io.BytesIO()
    book = xlsxwriter.Workbook(
        target, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
    )
    book.set_properties({"title": "Sagittal", "created": MADE})
    bold = book.add_format({"bold": True})
    for table in (
        sheets.list_about(content),
        sheets.list_parameters(content),
        sheets.list_cycles(content),
        sheets.list_curves(content),
        sheets.list_events(content),
        sheets.list_notices(content),
        sheets.list_dictionary(content),
    ):
        sheet = book.add_worksheet(table.name)
        sheet.write_row(0, 0, table.header, bold)
        for i, row in enumerate(table.rows, start=1):
            for j, value in enumerate(row):
                if isinstance(value, str):
                    sheet.write_string(i, j, value)
                elif isinstance(value, (int, float)) and isfinite(value):
                    sheet.write_number(i, j, value)
        sheet.freeze_panes(1, 0)
        if table.rows:
            sheet.autofilter(0, 0, len(table.rows), len(table.header) - 1)
        for j, name in enumerate(table.header):
            texts = [str(row[j]) for row in table.rows if isinstance(row[j], str)]
            sheet.set_column(j, j, min(WIDEST, 2 + max(map(len, (name, *texts)))))
    book.close()
    return target.getvalue()
