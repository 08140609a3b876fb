"""Shape of a table."""

from __future__ import annotations

import pytest

from sagittal.core.formats.tables.layout import find_layout, guess_separator, has_decimal_comma


def shape(*lines: str) -> tuple[str, int, int, bool] | None:
    found = find_layout([line.encode() for line in lines])
    if found is None:
        return None
    return found.separator.decode(), found.skip_rows, found.header_rows, found.decimal_comma


def test_semicolons_with_a_decimal_comma_in_every_column_are_not_cut_at_the_commas() -> None:
    rows = ["t;x;y;z", "0,000;-3,14;8,83;2,82", "0,010;-3,16;8,82;2,83"]
    assert shape(*rows) == (";", 0, 1, True)
    assert guess_separator([r.encode() for r in rows[1:]]) == b";"


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["sep=;", "t;x;y;z", "0;1;2;3,5", "1;1;2;3"], (";", 1, 1, True)),
        (["2024-02-07 11:27:27.350,1,2,3", "2024-02-07 11:27:27.360,1,2,3"], (",", 0, 0, False)),
        (["7.2.2024 11:27:27;0,5;0,5;1", "7.2.2024 11:27:28;0,5;0,5;1"], (";", 0, 0, True)),
        (["a,1", "b,2", "Time,Acc,,", ",X,Y,Z", "1,2,3,4", "2,2,3,4"], (",", 2, 2, False)),
        (["t x y z", "0.0  1.0 2 3", "0.1  1.0 2 3"], (" ", 0, 1, False)),
        (["once", "upon a time"], None),
    ],
)
def test_the_shape_is_found(lines: list[str], expected: tuple[str, int, int, bool] | None) -> None:
    assert shape(*lines) == expected


def test_dates_with_points_do_not_hide_decimal_commas() -> None:
    assert has_decimal_comma([b"7.2.2024 11:27:27;0;0,5"], b";")
    assert not has_decimal_comma([b"0.5;1.5"], b";")
