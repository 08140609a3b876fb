"""The tables of docs/reference/parameters.md, written from the catalogue: `python -m
tests.helpers.parameter_page`.

Each stands between `<!-- catalogue: heading -->` and `<!-- end -->`; what is around them is written by hand.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from sagittal.core.parameters.catalogue import CATALOGUE, NEEDS, CurveFigure, ParameterEntry
from tests.data import ROOT

PAGE: Final = ROOT / "docs" / "reference" / "parameters.md"

TABLE: Final = re.compile(r"(<!-- catalogue: (?P<group>[^>]+) -->\n).*?(?=<!-- end -->)", re.DOTALL)

STATISTICS: Final = {"at": "at contact", "max": "most", "min": "least", "range": "most − least"}


def render_page(text: str) -> str:
    """The page with its tables as the catalogue has them.

    Raises
    ------
    ValueError
        A group of the catalogue has no table, or a table no group.
    """
    groups = dict.fromkeys(entry.group for entry in CATALOGUE.values())
    written = [found["group"] for found in TABLE.finditer(text)]
    if sorted(written) != sorted(groups):
        raise ValueError(f"tables of {written}, expected one each of {list(groups)}")
    return TABLE.sub(lambda found: found[1] + "\n" + _table(found["group"]) + "\n", text)


def _table(group: str) -> str:
    rows = [_row(entry) for entry in CATALOGUE.values() if entry.group == group]
    head = ("name", "label", "unit", "definition", "needs", "norm", "change", "± from")
    lines = [" | ".join(cells) for cells in (head, ("---",) * len(head), *rows)]
    return "".join(f"| {line} |\n" for line in lines).replace("| --- ", "|---").replace("|--- |", "|---|")


def _row(entry: ParameterEntry) -> tuple[str, ...]:
    definition = entry.definition if entry.curve is None else f"{entry.definition} {_window(entry.curve)}"
    if entry.of == "take":
        definition += " One of the take."
    norm: str = "" if entry.norm is None else entry.norm.table
    if entry.norm is not None and entry.norm.differs is not None:
        norm += f", not comparable ({entry.norm.differs.replace('_', '-')})"
    needs = ", ".join(NEEDS[need] for need in entry.needs)
    change = (entry.change or "").replace("_", " ")
    known = "" if entry.errors is None else entry.errors.source
    return f"`{entry.name}`", entry.label, entry.printed_unit, definition, needs, norm, change, known


def _window(curve: CurveFigure) -> str:
    part = STATISTICS[curve.statistic]
    whole = (curve.start_pct, curve.end_pct) == (0, 100)
    return f"({part})" if whole else f"({part} in {curve.start_pct}–{curve.end_pct} %)"


def write_page(path: Path = PAGE) -> None:
    """Write the tables into the page."""
    path.write_text(render_page(path.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    write_page()
