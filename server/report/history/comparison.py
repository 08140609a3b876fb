"""Comparison of two sessions of a patient: all parameters before and after, changes and their assessment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from sagittal.core.change import NOT_MEASURED_ALIKE, Change, parameter_changes, withdraw_verdicts
from sagittal.core.frames import Side
from sagittal.core.norms import Norms
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.report.files.columns import write_csv
from sagittal.server.report.history.numbers import Numbers
from sagittal.server.report.history.trends import collect_figures
from sagittal.server.report.view.level import from_standing
from sagittal.server.report.view.table import ParameterRow
from sagittal.server.report.words.change_words import SCORE_TERMS, ChangeWords, change_words, find_term
from sagittal.server.report.words.wording import format_number, reason_words

STANDING: Final = "relative to standing"
"""Description of a change whose row has another zero."""

Group = tuple[str, tuple[ParameterRow, ...]]

NormsOfTwo = tuple[Norms, Norms]
"""References of the earlier and of the later session."""


@dataclass(frozen=True)
class ComparedRow:
    """A parameter of one side or of the whole trial.

    Parameters
    ----------
    before, after : as printed, "–" if not measured. reason : why the later value is missing, otherwise None.
    """

    title: str
    unit: str
    group: str
    side: Side | None
    before: str
    after: str
    words: ChangeWords
    reason: str | None
    change: Change


def compare_figures(
    earlier: Numbers, later: Numbers, norms: NormsOfTwo | None = None, affected: Side | None = None
) -> tuple[Change, ...]:
    """Changes of all parameters present in either session, in table order.

    Parameters
    ----------
    norms : for the earlier and the later session, each at its own speed; without them changes have no
        direction.
    """
    norm_values = None if norms is None else (norms[0].values, norms[1].values)
    keys = {(p.name, p.side) for n in (earlier, later) for p in collect_figures(n) if p.mean is not None}
    order = {name: i for i, name in enumerate((*CATALOGUE, *SCORE_TERMS))}
    changes = [
        c
        for c in parameter_changes(collect_figures(earlier), collect_figures(later), affected, norm_values)
        if (c.name, c.side) in keys
    ]
    return tuple(sorted(changes, key=lambda c: order.get(c.name, len(order))))


def compare_rows(
    earlier: Numbers,
    later: Numbers,
    norms: NormsOfTwo | None = None,
    affected: Side | None = None,
    *,
    comparable: bool = True,
) -> tuple[ComparedRow, ...]:
    """Table of a comparison; changes are not assessed if the walking conditions differ."""
    reasons = {(p.name, p.side): p.reason for p in collect_figures(later)}
    rows = []
    for change in compare_figures(earlier, later, norms, affected):
        c = change if comparable else withdraw_verdicts(change)
        term = find_term(c.name, c.unit)
        old, new = (
            "–" if value is None else format_number(value, term.digits) for value in (c.before, c.after)
        )
        reason = reason_words(reasons.get((c.name, c.side))) if c.after is None else None
        rows.append(
            ComparedRow(term.label, term.unit, term.group, c.side, old, new, change_words(c), reason, c)
        )
    return tuple(rows)


def add_changes(groups: Sequence[Group], changes: Sequence[Change]) -> tuple[Group, ...]:
    """Add changes since an earlier session to the rows of a table, where both have a value.

    Values with different measurement methods are marked as such. An angle relative to the anatomical zero
    shows the change relative to standing, which is available at every visit.
    """
    words: dict[str, list[ChangeWords]] = {}
    for c in changes:
        if c.difference is not None or c.reason == NOT_MEASURED_ALIKE:
            words.setdefault(c.name, []).append(change_words(c))

    def of(row: ParameterRow) -> tuple[ChangeWords, ...]:
        measured = from_standing(row.name)
        if measured is None:
            return tuple(words.get(row.name, ()))
        sides = {side for side, cell in (("left", row.left), ("right", row.right)) if cell is not None}
        return tuple(replace(w, about=STANDING) for w in words.get(measured, ()) if w.side in {None, *sides})

    return tuple((name, tuple(replace(row, change=of(row)) for row in rows)) for name, rows in groups)


def comparison_csv(rows: Sequence[ComparedRow]) -> bytes:
    """One row per parameter and side, with unrounded numbers."""
    header = (
        *("name", "side", "unit", "before", "after", "change", "verdict", "towards_norm"),
        *("mdc", "mdc_source", "mcid", "mcid_source", "reason"),
    )

    def cells() -> Iterator[Sequence[object]]:
        for c in (r.change for r in rows):
            yield (
                *(c.name, c.side or "", c.unit, c.before, c.after, c.difference, c.verdict, c.towards_norm),
                *(c.limit, c.limit_source, c.mcid, c.mcid_source, c.reason),
            )

    return write_csv(header, cells())
