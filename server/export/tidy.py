"""Tables for statistics: a zip of CSV files, long and wide, with a data dictionary."""

from __future__ import annotations

from sagittal.server.export import sheets
from sagittal.server.export.content import ExportContent
from sagittal.server.export.zipping import zip_files
from sagittal.server.report.files.columns import write_csv


def write_tidy(content: ExportContent) -> bytes:
    """Write strides_long.csv, strides_wide.csv, parameters.csv, curves.csv, events.csv, about.csv and
    data_dictionary.csv."""
    tables = {
        "strides_long.csv": sheets.list_values(content),
        "strides_wide.csv": sheets.list_cycles(content),
        "parameters.csv": sheets.list_parameters(content),
        "curves.csv": sheets.list_curves(content),
        "events.csv": sheets.list_events(content),
        "about.csv": sheets.list_about(content),
        "data_dictionary.csv": sheets.list_dictionary(content),
    }
    return zip_files({path: write_csv(table.header, table.rows) for path, table in tables.items()})
