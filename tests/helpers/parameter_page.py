"""Generate the tables of docs/reference/parameters.md: `python -m tests.helpers.parameter_page`.

A table is placed between `<!-- catalogue: heading -->` and `<!-- end -->`; the text around it is written by
hand.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from sagittal.core.parameters.catalogue import CATALOGUE, NEEDS, CurveFigure, ParameterEntry
from tests.data import ROOT

PAGE: Final = ROOT / "docs" / "reference" / "parameters.md"

TABLE: Final = re.compile(r"(<!-- catalogue: (?P<group>[^>]+) -->\n).*?(?=<!-- end -->)", re.DOTALL)

NEEDS_HEADING: Final = "needs"
"""Heading of the table that explains the keys of the column *needs*."""

Row = tuple[str, ...]

STATISTICS: Final = {"at": "at contact", "max": "maximum", "min": "minimum", "range": "maximum − minimum"}


def render_page(text: str) -> str:
    """Page with its tables generated from the catalogue.

    Raises
    ------
    ValueError
        Tables and groups of the catalogue do not match one to one.
    """
    headings = [NEEDS_HEADING, *dict.fromkeys(entry.group for entry in CATALOGUE.values())]
    present = [match["group"] for match in TABLE.finditer(text)]
    if sorted(present) != sorted(headings):
        raise ValueError(f"tables of {present}, expected one each of {headings}")

    def render(match: re.Match[str]) -> str:
        table = _needs_table() if match["group"] == NEEDS_HEADING else _table(match["group"])
        return f"{match[1]}\n{table}\n"

    return TABLE.sub(render, text)


def _table(group: str) -> str:
    rows = [_row(entry) for entry in CATALOGUE.values() if entry.group == group]
    return _format(("name", "label", "unit", "definition", "needs", "norm"), rows)


def _needs_table() -> str:
    return _format(("key", "needs"), [(f"`{key}`", text) for key, text in NEEDS.items()])


def _format(head: Row, rows: Sequence[Row]) -> str:
    lines = [" | ".join(cells) for cells in (head, ("---",) * len(head), *rows)]
    return "".join(f"| {line} |\n" for line in lines).replace("| --- ", "|---").replace("|--- |", "|---|")


def _row(entry: ParameterEntry) -> Row:
    definition = entry.definition if entry.curve is None else f"{entry.definition} {_window(entry.curve)}"
    if entry.of == "take":
        definition += " Per trial."
    norm: str = "" if entry.norm is None else entry.norm.table
    if entry.norm is not None and entry.norm.differs is not None:
        norm += f", not comparable ({entry.norm.differs.replace('_', '-')})"
    needs = " ".join(f"`{need}`" for need in entry.needs)
    return f"`{entry.name}`", entry.label, entry.printed_unit, definition, needs, norm


def _window(curve: CurveFigure) -> str:
    statistic = STATISTICS[curve.statistic]
    whole = (curve.start_pct, curve.end_pct) == (0, 100)
    return f"({statistic})" if whole else f"({statistic} in {curve.start_pct}–{curve.end_pct} %)"


def write_page(path: Path = PAGE) -> None:
    """Write the tables to the page."""
    path.write_text(render_page(path.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    write_page()
