"""Figures that a validation measures, and the report they are compared with.

Every accuracy test records its section, a table and a note. `python -m validation` collects the sections of a
run in a store and writes validation/report.md and docs/reference/accuracy.md from them (`validation.report`).
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Final, Literal

from tests.data import ROOT

REPORT: Final = ROOT / "validation" / "report.md"
STORE: Final = "SAGITTAL_VALIDATION_STORE"
"""Environment variable: the file to which figures are appended, one JSON object a line."""

IN_SHORT: Final = "In short"
"""Section with one row per key figure; it is printed in docs/reference/accuracy.md."""
GOALS: Final = "Speed: goals"
"""Section with one row per performance goal."""
GOALS_HEADER: Final = ("what", "goal", "measured", "met")

KEY_FIGURES: Final = (
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
"""Rows of `IN_SHORT`, in this order."""

Kind = Literal["section", "rows", "row"]

_NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?")


def record(
    section: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str = "", *, whole: bool = True
) -> None:
    """Record one section of the report and print how it differs from the last report.

    Parameters
    ----------
    section : its heading.
    header, rows : cells of the table. note : paragraph below it.
    whole : False if this run measured only some of the rows; those are compared, and the report keeps the
        section it has.
    """
    text = format_table(header, rows, note if whole else "")
    printed = read_sections().get(section, "")
    if not whole:
        printed = _select_rows(printed, text)
    _print_differences(section, printed, text)
    _store("section" if whole else "rows", section, text)


def record_in_short(figure: str, peer: str, ours: str, on: str) -> None:
    """Record one row of the table of key figures.

    Parameters
    ----------
    figure : one of `KEY_FIGURES`.
    peer : the value of a paper or of another program, with its source.
    ours : the value measured. on : the recordings it was measured on.
    """
    if figure not in KEY_FIGURES:
        raise ValueError(f"'{figure}' is not one of KEY_FIGURES")
    _record_row(IN_SHORT, ("figure", "paper or peer", "ours", "on what"), (figure, peer, ours, on))


def record_speed(section: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> None:
    """Record one table of CPU times or memory; other machines give other figures, so nothing is compared."""
    _store("section", f"Speed: {section}", format_table(header, rows, note))


def record_goal(label: str, goal: float, ours: float, unit: str, *, at_least: bool = False) -> None:
    """Record whether a performance goal is met.

    Parameters
    ----------
    at_least : whether more is better.
    """
    _store("row", GOALS, format_line(judge_goal(label, goal, ours, unit, at_least=at_least)))


def judge_goal(label: str, goal: float, ours: float, unit: str, *, at_least: bool = False) -> tuple[str, ...]:
    """Cells of a goal's row: what, the goal, the value measured, whether it is met."""
    met = ours >= goal if at_least else ours <= goal
    value = f"{ours:.0f}" if ours >= 100.0 else f"{ours:.3g}"
    sign = "≥" if at_least else "≤"
    return (label, f"{sign} {goal:g} {unit}".rstrip(), f"{value} {unit}".rstrip(), "yes" if met else "no")


def _record_row(section: str, header: Sequence[str], cells: Sequence[str]) -> None:
    row = format_line(cells)
    _print_differences(section, _select_rows(read_sections().get(section, ""), row), row)
    _store("row", section, "\n".join((format_line(header), row)))


def _print_differences(section: str, printed: str, measured: str) -> None:
    if differences := find_differences(printed, measured):
        sys.stdout.write(f"differs from the last report, '{section}':\n" + "\n".join(differences) + "\n")


def _store(kind: Kind, section: str, text: str) -> None:
    path = os.environ.get(STORE)
    if path:
        line = json.dumps({"kind": kind, "section": section, "text": text}, ensure_ascii=False)
        with Path(path).open("a", encoding="utf-8") as file:
            file.write(f"{line}\n")


def _select_rows(printed: str, measured: str) -> str:
    """Lines of a printed table whose first cell the measured one has; an empty cell repeats the one above."""
    names, selected, cell = {line.split(" | ")[0] for line in measured.splitlines()}, [], ""
    for line in printed.splitlines():
        cell = line.split(" | ")[0] if line.split(" | ")[0].strip("| ") else cell
        if cell in names:
            selected.append(line)
    return "\n".join(selected)


def find_differences(printed: str, measured: str) -> list[str]:
    """Lines of a section that differ, as `- printed`, `+ measured`.

    Numbers may differ by one unit of their last digit: another processor rounds differently.
    """
    pairs = zip_longest(printed.strip().splitlines(), measured.strip().splitlines(), fillvalue="")
    return [line for old, new in pairs if not _agree(old, new) for line in (f"- {old}", f"+ {new}")]


def read_sections(path: Path = REPORT) -> dict[str, str]:
    """Sections of a report: heading → text below it."""
    if not path.exists():
        return {}
    parts = path.read_text(encoding="utf-8").split("\n## ")[1:]
    return {title.strip(): body.strip() for title, _, body in (part.partition("\n") for part in parts)}


def format_table(header: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> str:
    """A Markdown table, with a paragraph below it."""
    lines = [format_line(header), format_line(["---"] * len(header)), *map(format_line, rows)]
    return "\n".join(lines) + (f"\n\n{note}" if note else "")


def format_line(cells: Sequence[str]) -> str:
    """One line of a Markdown table."""
    return "| " + " | ".join(cells) + " |"


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
