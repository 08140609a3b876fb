"""How the text of a table is cut: separator, decimal mark, lines before and of the header."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from sagittal.core.formats import text

_MOST_HEADER: Final = 3
_LEAST_CELLS: Final = 3
_MOST_TEXTS: Final = 0.35
"""Share of a row's cells that may be texts, such as a date, a label, a status [our choice]."""
LINES: Final = 80
"""Lines of the beginning that are looked at."""
_COMMA: Final = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_POINT: Final = re.compile(r"[-+]?\d*\.\d+(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class TableLayout:
    """Shape of a table.

    Parameters
    ----------
    separator : between cells. skip_rows : lines before the header. header_rows : of the header, 0 = none.
    columns : cells of a row. index_column : the header has one cell less, the first column has no name.
    decimal_comma : numbers are written 0,5.
    """

    separator: bytes
    skip_rows: int
    header_rows: int
    columns: int
    index_column: bool
    decimal_comma: bool

    @property
    def first_row(self) -> int:
        """Lines before the first row of numbers."""
        return self.skip_rows + self.header_rows


def find_layout(lines: Sequence[bytes], separator: bytes | None = None) -> TableLayout | None:
    """The shape of a table from its first lines; None where no two neighbouring rows of numbers are found.

    Parameters
    ----------
    lines : from the start of the file. separator : where it is known.
    """
    best: tuple[int, int, bytes, int] | None = None
    for candidate in (separator,) if separator else text.SEPARATORS:
        cut = [cells(line, candidate) for line in lines]
        numbers = [count_numbers(row, candidate) for row in cut]
        for i, j in pairwise(k for k, row in enumerate(cut) if row != [""]):
            alike = len(cut[i]) == len(cut[j]) and len(cut[i]) >= _LEAST_CELLS
            if alike and is_row(cut[i], numbers[i]) and is_row(cut[j], numbers[j]):
                if best is None or (numbers[i], len(cut[i])) > best[:2]:
                    best = numbers[i], len(cut[i]), candidate, i
                break
    if best is None:
        return None
    _, width, best_separator, first = best
    header = _count_header(lines, first, width, best_separator)
    named = cells(lines[first - 1], best_separator) if header else []
    return TableLayout(
        best_separator,
        first - header,
        header,
        width,
        len(named) == width - 1,
        has_decimal_comma(lines[first:], best_separator),
    )


def guess_separator(rows: Sequence[bytes]) -> bytes | None:
    """The separator that cuts rows without a header into most numbers, all into as many cells."""
    best: tuple[int, int] = (0, 1)
    best_separator = None
    for separator in text.SEPARATORS:
        cut = [cells(row, separator) for row in rows if row.strip()]
        if len({len(row) for row in cut}) != 1:
            continue
        score = min(count_numbers(row, separator) for row in cut), len(cut[0])
        if score > best and score[1] > 1:
            best, best_separator = score, separator
    return best_separator


def has_decimal_comma(rows: Sequence[bytes], separator: bytes) -> bool:
    """Tell "0,074;9,922" from "0.074;9.922" by the cells that are numbers, not by dates among them."""
    if separator == b",":
        return False
    commas = points = 0
    for row in rows[:LINES]:
        if b"," in row:
            row_cells = cells(row, separator)
            commas += sum(_COMMA.fullmatch(c) is not None for c in row_cells)
            points += sum(_POINT.fullmatch(c) is not None for c in row_cells)
    return commas > points


def first_rows(body: memoryview) -> list[bytes]:
    """First lines of rows without a header."""
    return text.head_lines(bytes(body[: 1 << 16]), LINES)


def cells(line: bytes, separator: bytes) -> list[str]:
    """Cells of a line; a run of blanks separates once."""
    return text.split(text.squeeze_blanks(line) if separator == b" " else line, separator)


def count_numbers(row: Sequence[str], separator: bytes) -> int:
    """Cells that are numbers; a decimal comma is one where commas do not separate."""
    comma = separator != b","
    return sum(_is_number(cell.replace(",", ".") if comma else cell) for cell in row)


def is_row(row: Sequence[str], numbers: int) -> bool:
    """Whether a row with this many numbers holds measured values; blanks and a few texts are tolerated."""
    texts = len(row) - numbers - sum(cell in text.MISSING for cell in row)
    return numbers >= _LEAST_CELLS and texts <= max(1.0, _MOST_TEXTS * len(row))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _count_header(lines: Sequence[bytes], first: int, width: int, separator: bytes) -> int:
    """Lines right before the first row that name its columns."""
    header = 0
    while header < min(_MOST_HEADER, first):
        row = cells(lines[first - header - 1], separator)
        ends = next((i for i, c in enumerate(reversed(row)) if c), 0)
        near = len(row) in (width, width - 1) or len(row) - ends <= width <= len(row)
        partly = header > 0 and 2 <= len(row) < width and row[0] != "" and count_numbers(row, separator) == 0
        names = any(row) and count_numbers(row, separator) <= len(row) // 2
        if not names or not (near or partly) or text.read_separator(lines[first - header - 1]):
            break
        header += 1
    return header
