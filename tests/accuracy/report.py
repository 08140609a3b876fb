"""docs/accuracy.md: every accuracy test compares its section with what it has measured, or writes it anew.

`pytest -m accuracy` compares, `pytest -m accuracy --write-figures` writes. docs/performance.md is only
written.
"""

from __future__ import annotations

import fcntl
import os
import re
from collections.abc import Callable, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Final

from tests.data import ROOT

PATH: Final = ROOT / "docs" / "accuracy.md"
WRITE: Final = "SAGITTAL_WRITE_FIGURES"
"""Set in the environment by `--write-figures`, so that every test process knows."""
HEAD: Final = """# Accuracy

Measured by `tests/accuracy` on real recordings (`SAGITTAL_DATA`) and on simulated people. Do not edit: run
`pytest -m accuracy --write-figures`. Each section names its limits; the tests fail beyond them, and when a
figure is not the one printed here."""

PERFORMANCE: Final = ROOT / "docs" / "performance.md"
PERFORMANCE_HEAD: Final = """# Performance

Measured by `tests/bench` on two cores that others use, too, as CPU time. Do not edit: run
`pytest -n 0 -m bench --write-figures tests/bench`, or a file of it. Figures of another machine are others:
nothing is compared with this page; what the tests ask for are ratios and limits."""

GOALS: Final = "Goals"
"""The section of docs/performance.md that has one row a goal."""
GOALS_NOTE: Final = (
    "Goals are those of a quiet machine; on one that others use, CPU time is up to a quarter longer. Every "
    "bench writes its own rows; one that was not run keeps what stood there."
)

IN_SHORT: Final = "In short"
"""The first section: one row a figure."""
FIGURES: Final = (
    "Flexion of hip / knee / ankle, seven sensors: RMSE °",
    "The same live",
    "The same with three sensors (L7S)",
    "The same with two sensors (L7S)",
    "Hip flexion / rotation / adduction of Potter's walker: RMS °",
    "Sagittal score (GPS), left / right °",
    "Contact (IC) ms",
    "Foot-off (TC) ms",
    "Stride time ms",
    "Stride length mm",
    "Foot pitch at contact °",
    "Steps of one lower-back sensor: F1",
    "Live cue − final value, knee flexion °",
)
"""Rows of the first section, in this order."""

_NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?")


def record(
    section: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str = "", *, whole: bool = True
) -> None:
    """Compare one section of docs/accuracy.md, a table and a note, with what was measured; or replace it.

    Parameters
    ----------
    whole : False where this run has measured some of the rows: those and the header are compared, the note is
        not. Where figures are written it must have all.

    Raises
    ------
    AssertionError
        a word differs, or a number by more than one unit of its last printed digit.
    """
    text = _table(header, rows, note if whole else "")
    if os.environ.get(WRITE):
        assert whole, f"'{section}' would lose the rows that were not measured"
        _replace(section, lambda _: text)
        return
    printed = read_sections().get(section)
    assert printed is not None, f"docs/accuracy.md has no section '{section}': {_HOW}"
    if not whole:
        printed = _choose_rows(printed, text)
    differences = find_differences(printed, text)
    assert not differences, f"docs/accuracy.md, '{section}': {_HOW}\n" + "\n".join(differences)


def _choose_rows(printed: str, measured: str) -> str:
    """Lines of a printed table whose first cell the measured one has; an empty cell is as the one above."""
    names, chosen, cell = {line.split(" | ")[0] for line in measured.splitlines()}, [], ""
    for line in printed.splitlines():
        cell = line.split(" | ")[0] if line.split(" | ")[0].strip("| ") else cell
        if cell in names:
            chosen.append(line)
    return "\n".join(chosen)


def record_speed(section: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> None:
    """Replace one section of docs/performance.md, where figures are written; nothing is compared with it."""
    if os.environ.get(WRITE):
        text = _table(header, rows, note)
        _replace(section, lambda _: text, PERFORMANCE, PERFORMANCE_HEAD)


def record_goal(what: str, goal: float, ours: float, unit: str, *, at_least: bool = False) -> None:
    """Put a goal and what was measured into docs/performance.md, where figures are written.

    Parameters
    ----------
    at_least : more is better; otherwise less.
    """
    if os.environ.get(WRITE):
        row = tell_goal(what, goal, ours, unit, at_least=at_least)
        _replace(GOALS, lambda text: put_goal(text, row), PERFORMANCE, PERFORMANCE_HEAD)


def tell_goal(what: str, goal: float, ours: float, unit: str, *, at_least: bool = False) -> str:
    """Row of a goal: what, how much, what was measured, whether it is met."""
    met = ours >= goal if at_least else ours <= goal
    shown = f"{ours:.0f}" if ours >= 100.0 else f"{ours:.3g}"
    sign = "≥" if at_least else "≤"
    return _line(
        (what, f"{sign} {goal:g} {unit}".rstrip(), f"{shown} {unit}".rstrip(), "yes" if met else "no")
    )


def put_goal(text: str, row: str) -> str:
    """A section of goals with this row in the place of that name's, or behind all; the rest stays."""
    if not text:
        text = _table(("what", "goal", "ours", "met"), [], GOALS_NOTE)
    lines = text.splitlines()
    table = [line for line in lines if line.startswith("|")]
    rows = {line.split(" | ")[0]: line for line in table[2:]} | {row.split(" | ")[0]: row}
    rest = "\n".join(line for line in lines if not line.startswith("|")).strip()
    return "\n".join([*table[:2], *rows.values()]) + f"\n\n{rest}"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], note: str) -> str:
    lines = [_line(header), _line(["---"] * len(header)), *(_line(row) for row in rows)]
    return "\n".join(lines) + (f"\n\n{note}" if note else "")


def record_in_short(figure: str, peer: str, ours: str, on: str) -> None:
    """Compare one row of the first section of docs/accuracy.md with what was measured; or replace it.

    Parameters
    ----------
    figure : one of FIGURES.
    peer : what a paper or another program has, and which.
    ours : what was measured here.
    on : on which recordings.
    """
    rows = {row.split(" | ")[0]: row for row in read_sections().get(IN_SHORT, "").splitlines()[2:]}
    key, row = f"| {figure}", _line((figure, peer, ours, on))
    if os.environ.get(WRITE):
        _replace(IN_SHORT, lambda text: _put_row(text, key, row))
        return
    assert key in rows, f"docs/accuracy.md does not have '{figure}': {_HOW}"
    differences = find_differences(rows[key], row)
    assert not differences, f"docs/accuracy.md, '{figure}': {_HOW}\n" + "\n".join(differences)


def _put_row(text: str, key: str, row: str) -> str:
    rows = {r.split(" | ")[0]: r for r in text.splitlines()[2:]} | {key: row}
    head = ["figure", "paper or peer", "ours", "on what"]
    order = [f"| {figure}" for figure in FIGURES]
    lines = [_line(head), _line(["---"] * len(head)), *(rows[k] for k in order if k in rows)]
    return "\n".join(lines)


_HOW: Final = "run pytest -m accuracy --write-figures and look at what changed"


def find_differences(printed: str, measured: str) -> list[str]:
    """Lines of a section that say something else than what was measured, as `- printed`, `+ measured`.

    Numbers may differ by one unit of their last digit: another processor rounds otherwise.
    """
    pairs = zip_longest(printed.strip().splitlines(), measured.strip().splitlines(), fillvalue="")
    return [line for old, new in pairs if not _agree(old, new) for line in (f"- {old}", f"+ {new}")]


def read_sections(path: Path = PATH) -> dict[str, str]:
    """Sections as they stand, title → body."""
    if not path.exists():
        return {}
    parts = path.read_text(encoding="utf-8").split("\n## ")[1:]
    return {title.strip(): body.strip() for title, _, body in (part.partition("\n") for part in parts)}


def _replace(section: str, change: Callable[[str], str], path: Path = PATH, head: str = HEAD) -> None:
    # several test processes may write at once
    with (ROOT / "pyproject.toml").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        sections = read_sections(path)
        sections[section] = change(sections.get(section, ""))
        names = sorted(sections, key=lambda name: (name != IN_SHORT, name))
        whole = "\n\n".join([head, *(f"## {name}\n\n{sections[name]}" for name in names)]) + "\n"
        if not path.exists() or path.read_text(encoding="utf-8") != whole:
            path.write_text(whole, encoding="utf-8")


def _agree(old: str, new: str) -> bool:
    if _NUMBER.sub("#", old) != _NUMBER.sub("#", new):
        return False
    return all(
        abs(_value(a) - _value(b)) <= 1.001 * max(_unit(a), _unit(b))
        for a, b in zip(_NUMBER.findall(old), _NUMBER.findall(new), strict=True)
    )


def _value(number: str) -> float:
    return float(number.replace("−", "-"))


def _unit(number: str) -> float:
    return 10.0 ** -len(number.partition(".")[2])


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
