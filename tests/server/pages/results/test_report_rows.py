"""Placement of rows in the parameter table."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from sagittal.core.parameters.catalogue.entry import FUNCTIONAL, SQUAT
from sagittal.server.pages.results.report_rows import (
    FIRST_ROWS,
    MATTERING,
    NOT_ON_PAPER,
    SECONDARY,
    fold_groups,
    select_first,
    select_groups,
    select_others,
)
from sagittal.server.report.view.table import ParameterRow, TableCell


@dataclass
class Shown:
    """What of a report decides."""

    page_groups: tuple[tuple[str, tuple[ParameterRow, ...]], ...]
    squats: Any = None
    functional: Any = None
    strides: tuple[Any, ...] = (1,)


def row(name: str, group: str = "Times", reason: str | None = None, z: float | None = None) -> ParameterRow:
    cell = None if reason else TableCell(1.0, 0.1, 20, "1.0", "", z=z)
    return ParameterRow(name, name, "", group, cell, None, None, None, reason, (0.0, 1.0))


def names(rows: Any) -> list[str]:
    return [r.name for r in rows]


def model(*rows: ParameterRow, **more: Any) -> Any:
    groups: dict[str, list[ParameterRow]] = {}
    for one in rows:
        groups.setdefault(one.group, []).append(one)
    return Shown(tuple((name, tuple(mine)) for name, mine in groups.items()), **more)


def test_ten_of_those_that_matter_come_first_in_their_order() -> None:
    rows = [row(name) for name in reversed(MATTERING)]
    rows[-2] = row(MATTERING[1], reason="not measured")
    result = names(select_first(model(*rows, row("swing_pct"))))
    assert result == [MATTERING[0], *MATTERING[2 : FIRST_ROWS + 1]]
    assert names(select_first(model(row("swing_pct")))) == []


def test_of_squats_all_comes_first_and_of_a_test_what_was_measured() -> None:
    squats = model(row("gait_speed_mps"), row("x", SQUAT), row("y", SQUAT, "none"), squats=object())
    assert names(select_first(squats)) == ["x", "y"]
    rows = (row("gait_speed_mps"), row("x", FUNCTIONAL[0]), row("y", FUNCTIONAL[-1], "none"))
    assert names(select_first(model(*rows, functional=object(), strides=()))) == ["x"]
    assert names(select_first(model(*rows, functional=object()))) == ["gait_speed_mps"]


def test_the_head_of_a_group_tells_how_many_are_beyond_the_norm() -> None:
    rows = [row("a"), row("b", z=2.0), row("c", z=-2.1), row("d", "Turns"), row("e", "Turns", z=3.0)]
    whole = model(*rows)
    folded = fold_groups(whole, (rows[0],))
    assert [(g["name"], names(g["rows"]), g["words"]) for g in folded] == [
        ("Times", ["b", "c"], "2 values, 1 beyond 2 SD"),
        ("Turns", ["d", "e"], "2 values, 1 beyond 2 SD"),
    ]
    assert fold_groups(whole, rows) == []
    assert fold_groups(model(row("a")), ())[0]["words"] == "1 value"
    sides = replace(rows[0], both=None, left=TableCell(1.0, 0.1, 20, "1.0", "", z=-9.0))
    assert fold_groups(model(sides), ())[0]["words"] == "1 value, 1 beyond 2 SD"


def test_paper_has_only_what_was_measured_and_the_page_all_but_what_is_folded() -> None:
    rows = [
        row("a"),
        row("b", reason="none"),
        row(NOT_ON_PAPER[0]),
        row("c", SECONDARY[0]),
        row("d", "Turns", "none"),
    ]
    whole = model(*rows)
    assert [(n, names(r)) for n, r in select_groups(whole, paper=False)] == [
        ("Times", ["a", "b", NOT_ON_PAPER[0]]),
        ("Turns", ["d"]),
    ]
    assert [(n, names(r)) for n, r in select_groups(whole, paper=True)] == [("Times", ["a"])]
    assert select_others(whole, (rows[0],)) == []
    assert [(n, names(r)) for n, r in select_others(whole, ())] == [("Times", ["a"])]


def test_without_a_number_there_is_no_table() -> None:
    for paper in (True, False):
        assert select_groups(model(row("a", reason="none"), row("c", SECONDARY[0])), paper=paper) == []
