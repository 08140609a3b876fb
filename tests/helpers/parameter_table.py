"""The table of parameters: on which take, at which stage and with which other value each changes a result."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.helpers.parameter_changes import list_parameters

TABLE: Final = Path(__file__).parent / "pipeline_parameters.csv"
COLUMNS: Final = ("parameter", "take", "stage", "value")


@dataclass(frozen=True)
class Row:
    """A change of one parameter that changes what one stage makes of one take."""

    parameter: str
    take: str
    stage: str
    value: object

    @property
    def path(self) -> tuple[str, ...]:
        """As `Parameter.path`."""
        return tuple(re.findall(r"\[[^]]*]|[^.[]+", self.parameter))


def read_rows() -> list[Row]:
    """All rows of the table; none where there is no table yet."""
    if not TABLE.exists():
        return []
    with TABLE.open(encoding="utf-8", newline="") as f:
        return [
            Row(r["parameter"], r["take"], r["stage"], _read_value(r["value"])) for r in csv.DictReader(f)
        ]


def write_rows(rows: Iterable[Row]) -> None:
    """Write the table in the order of the configuration."""
    order = {p.name: i for i, p in enumerate(list_parameters())}
    stored_items = sorted((r for r in rows if r.parameter in order), key=lambda r: order[r.parameter])
    with TABLE.open("w", encoding="utf-8", newline="") as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows((r.parameter, r.take, r.stage, json.dumps(r.value)) for r in stored_items)


def _read_value(text: str) -> object:
    value = json.loads(text)
    return tuple(value) if isinstance(value, list) else value
